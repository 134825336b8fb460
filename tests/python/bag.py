"""A punch on an ESC out of the bag: no motor may lose its rotor, or trip, by its own throttle.

    target/venv/bin/python tests/python/bag.py --motors 20 --jobs 2

plays each propeller bench of the library and this many random motors, of which nothing is told but the limits and the
dead time, with several PWM frequencies: throttle 0.3, full, idle, and full again. It prints a row for each, and exits
with status 1 if one does not hold.
"""

import random
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import campaign
import paths

sys.path.insert(0, str(paths.DIALECT))

# They need the dialect's folder.
from motors import any_motor, drawn_bench, flown, motor_of  # noqa: E402
from out_of_the_bag import FACTORY, MOST_CURRENT, limits  # noqa: E402
from slams import IDLE  # noqa: E402
from thrust import PROPELLERS, bench  # noqa: E402
from windmill import market_motor  # noqa: E402

FREQUENCIES_HZ = [24_000, 48_000, 60_000]
OPENS_S, FULL_S, IDLE_S, AGAIN_S, END_S = 0.5, 1.5, 2.5, 3.0, 4.0
AGAIN_SHARE = 0.95
PACK_6S = {"bus": 24.0}
RACER_6S = {"name": "2207-kv1950", "flux": 0.404e-3}
"""The 5-inch bench's motor, wound for six cells."""


@dataclass(frozen=True)
class Outcome:
    """What a punch has done to a motor that nobody has told the ESC about."""

    told: list
    """Faults and warnings."""
    starts: int
    """After the first."""
    again: float
    """Speed at full throttle the second time over the first."""
    current: float
    """The largest of a phase, over LIM_PHASE_A."""

    def holds(self) -> bool:
        kept = not self.told and self.starts == 0
        return kept and abs(self.again - 1) < 1 - AGAIN_SHARE and self.current < MOST_CURRENT


def punched(folder: Path, tables: dict, told: dict, pwm_hz: float) -> Outcome:
    """Plays the punch with a bench's tables and what is told of its board."""
    tables["bench"] |= {"plant": "switching", "duration_s": END_S}
    tables["params"] = FACTORY | told | {"PWM_FREQ_HZ": pwm_hz}
    throttle = [(0.0, 0.0), (OPENS_S, 0.3), (FULL_S, 1.0), (IDLE_S, IDLE), (AGAIN_S, 1.0)]
    windows = {
        "all": (OPENS_S, END_S),
        "turning": (FULL_S - 0.2, END_S),
        "first": (IDLE_S - 0.1, IDLE_S),
        "again": (END_S - 0.1, END_S),
    }
    warned, seen = flown(folder, tables, throttle, windows)
    again = seen["again"]["rpm_mean"] / max(1.0, seen["first"]["rpm_mean"])
    current = seen["all"]["current_max_a"] / told.get("LIM_PHASE_A", 20.0)
    return Outcome(warned, seen["turning"]["starts"], again, current)


def of_library(folder: Path, name: str, pwm_hz: float) -> Outcome:
    """Plays a bench of the library; `racer-6s` is the 5-inch one with a motor and a supply for six cells."""
    racer = name == "racer-6s"
    own = bench("quad-5-inch" if racer else name)
    tables = {"bench": {"base": "quad-5-inch" if racer else name}}
    told = limits(own)
    if racer:
        tables["bench"] |= PACK_6S
        tables["bench.motor"] = own["bench"]["motor"] | RACER_6S
        told["LIM_BUS_V_MAX"] = 30.0
    return punched(folder, tables, told, pwm_hz)


def drawn(folder: Path, number: int, pwm_hz: float) -> Outcome:
    """Plays the random motor of this number: of any size, of a propeller's power, or of the market."""
    draw = random.Random(f"bag {number}")
    make = (any_motor, motor_of, None)[number % 3]
    if make is None:
        tables = market_motor(draw)
        told = limits(tables)
        tables.pop("bench.scale")
    else:
        motor = make(draw)
        tables, told = drawn_bench(motor), limits(motor)
    return punched(folder, tables, told, pwm_hz)


def main() -> int:
    given = campaign.words(__doc__, motors=20)
    cases = [(of_library, case) for case in product([*PROPELLERS, "racer-6s"], FREQUENCIES_HZ)]
    cases += [(drawn, case) for case in product(campaign.numbers(given), FREQUENCIES_HZ)]
    held = 0
    print(f"{'motor':<14} {'PWM kHz':>7} {'held':<4} {'starts':>6} {'again':>5} {'current':>7}  faults, warnings")
    for (_, (name, pwm_hz)), outcome in campaign.played(
        cases, lambda folder, case: case[0](folder, *case[1]), given.jobs
    ):
        held += outcome.holds()
        row = f"{name:<14} {pwm_hz / 1e3:>7.0f} {'yes' if outcome.holds() else 'NO':<4} {outcome.starts:>6}"
        told = ", ".join(map(str, outcome.told))
        print(f"{row} {outcome.again:>5.2f} {outcome.current:>7.2f}  {told}".rstrip(), flush=True)
    print(f"{held} of {len(cases)} hold")
    return 0 if held == len(cases) else 1


if __name__ == "__main__":
    sys.exit(main())
