"""Sags: full throttle on packs that are nearly empty, of any resistance, with wires of any inductance.

    target/venv/bin/python tests/python/sags.py --motors 100 --jobs 2

plays each of this many random motors with either drive on a pack of its own, and prints a row for each; it exits with
status 1 if one does not hold.
"""

import random
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import campaign
import paths

sys.path.insert(0, str(paths.DIALECT))

from motors import any_motor, drawn_bench, flown, log_uniform, motor_of, toml, tune  # noqa: E402

FIELD_ORIENTED, SIX_STEP = 0, 1
DRIVES = {"foc": FIELD_ORIENTED, "six-step": SIX_STEP}
VOLTAGE = 2
CRUISE = 0.25
HUNTING = 0.1
"""Greatest range of the speed at full throttle over its mean."""


@dataclass(frozen=True)
class Outcome:
    """What a sag has done to a drive."""

    told: list
    """Faults and warnings."""
    starts: int
    hunting: float
    """Range of the speed at full throttle over its mean."""
    again: float
    """Speed at cruise after full throttle over that before."""

    def holds(self) -> bool:
        return not self.told and self.starts == 0 and self.hunting < HUNTING and abs(self.again - 1) < 0.05


def motor_for(number: int, drive: int) -> dict:
    """Draws the motor of this number, which the drive can follow up to its greatest speed."""
    if drive == FIELD_ORIENTED and number % 2:
        return any_motor(random.Random(number))
    draw = random.Random(number)
    while True:
        motor = motor_of(draw)
        of = motor["params"]
        turns_hz = of["CTL_RPM_MAX"] / 60 * of["MOT_POLE_PAIRS"]
        if drive == FIELD_ORIENTED:
            of["PWM_FREQ_HZ"] = tune(of)["PWM_FREQ_HZ"]
            return motor
        if turns_hz < 2000:
            # 24 periods a turn, and a tenth more.
            of["PWM_FREQ_HZ"] = max(24e3, 26.4 * turns_hz)
            return motor


def drawn(folder: Path, number: int, drive: str) -> Outcome:
    """Plays cruise, full throttle and cruise. LIM_BUS_V_MIN is 3 to 25 % below the resting pack's voltage, and full
    power takes 0.8 to 3 times that, but no more than 35 % of it."""
    motor = motor_for(number, DRIVES[drive])
    draw = random.Random(f"{number} {drive}")
    rest_v = motor["supply_v"]
    headroom = draw.uniform(0.03, 0.25)
    full_a = 1.2 * motor["drag"] * (motor["rpm"] * 0.10472) ** 3 / rest_v
    pack = {
        "volts": rest_v,
        "resistance_mohm": 1e3 * min(draw.uniform(0.8, 3) * headroom, 0.35) * rest_v / full_a,
        "inductance_uh": log_uniform(draw, 0.03, 5.0),
        "capacitance_uf": log_uniform(draw, 47.0, 1000.0),
    }
    (folder / "pack.toml").write_text(toml(pack))
    tables = drawn_bench(motor)
    tables["bench"] |= {"bus": "pack.toml", "plant": draw.choice(["averaged", "switching"]), "duration_s": 5.2}
    mode = draw.choice([0, VOLTAGE]) if drive == "foc" else VOLTAGE
    own = {"LIM_BUS_V_MIN": (1 - headroom) * rest_v, "CTL_DRIVE": DRIVES[drive], "CTL_MODE": mode}
    tables["params"] = motor["params"] | own
    throttle = [(0.0, 0.0), (0.5, CRUISE), (3.0, 1.0), (4.0, CRUISE)]
    windows = {"before": (2.8, 3.0), "full": (3.6, 4.0), "again": (5.0, 5.2), "all": (2.8, 5.2)}
    told, found = flown(folder, tables, throttle, windows)
    full, before = found["full"], found["before"]["rpm_mean"]
    hunting = (full["rpm_max"] - full["rpm_min"]) / abs(full["rpm_mean"])
    return Outcome(told, found["all"]["starts"], hunting, found["again"]["rpm_mean"] / before)


def main() -> int:
    given = campaign.words(__doc__, motors=20)
    cases = list(product(campaign.numbers(given), DRIVES))
    held = 0
    print(f"{'motor':>5} {'drive':<8} {'held':<5} {'starts':>6} {'hunting':>7} {'again':>5}  faults, warnings")
    for (number, drive), outcome in campaign.played(cases, lambda folder, case: drawn(folder, *case), given.jobs):
        held += outcome.holds()
        row = f"{number:>5} {drive:<8} {'yes' if outcome.holds() else 'NO':<5} {outcome.starts:>6}"
        told = ", ".join(map(str, outcome.told))
        print(f"{row} {outcome.hunting:>7.3f} {outcome.again:>5.2f}  {told}".rstrip(), flush=True)
    print(f"{held} of {len(cases)} hold")
    return 0 if held == len(cases) else 1


if __name__ == "__main__":
    sys.exit(main())
