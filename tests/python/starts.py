"""Starts: from rest at any angle to 80 % of idle speed, on random motors, known and unknown.

    target/venv/bin/python tests/python/starts.py --motors 500 --jobs 2

starts each in speed and in voltage mode at idle throttle, and with factory settings at one from idle to four times
that, and prints a row for each; it exits with status 1 if more than one in fifty of any takes longer than 0.2 s, or
0.4 s if its inertia is large.
"""

import math
import random
import statistics
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import campaign
import paths

sys.path.insert(0, str(paths.DIALECT))

# They need the dialect's folder.
from motors import FROM_MOTOR, any_motor, drawn_bench, flown, motor_of, tune  # noqa: E402
from out_of_the_bag import FACTORY, limits  # noqa: E402
from slams import IDLE, PLANTS, SPEED, VOLTAGE  # noqa: E402

SHARE = 0.8
OPENS_S, END_S = 0.4, 1.6
STEP_S, STEPS = 0.02, 40
LIMIT_S, LARGE_LIMIT_S = 0.2, 0.4
LATE = 0.02
DEAD_TIMES_NS = [100, 200, 300, 500, 750, 1000]
DRIVES = {"speed": {"CTL_MODE": SPEED}, "voltage": {"CTL_MODE": VOLTAGE}, "unknown": {}}
LARGE_SWING_S = 0.035
"""Period of the rotor's swing about a current of LIM_PHASE_A, between the library's 15-inch and 28-inch benches'."""


@dataclass(frozen=True)
class Outcome:
    """What idle throttle has done to a motor at rest."""

    told: list
    """Faults and warnings."""
    starts: int
    took_s: float
    """From the throttle to 80 % of the idle speed for good; infinite if never."""
    limit_s: float
    """The longest that it may take."""
    back_deg: float
    """How far it turned back, mechanical."""
    current_a: float
    """The largest of a phase."""

    def is_in_time(self) -> bool:
        return not self.told and self.took_s <= self.limit_s


def started(folder: Path, tables: dict, limit_s: float, throttle: float = IDLE) -> Outcome:
    """Opens the throttle to idle, or further."""
    tables["bench"]["duration_s"] = END_S
    steps = range(1, STEPS + 1)
    windows = {f"from {n}": (OPENS_S + n * STEP_S, END_S) for n in steps}
    windows |= {"all": (0.0, END_S), "end": (END_S - 0.3, END_S)}
    told, windows = flown(folder, tables, [(0.0, 0.0), (OPENS_S, throttle)], windows)
    whole, idle_rpm = windows["all"], windows["end"]["rpm_mean"] * IDLE / throttle
    held = [n * STEP_S for n in steps if windows[f"from {n}"]["rpm_min"] >= SHARE * idle_rpm > 0]
    took_s = min(held, default=math.inf)
    return Outcome(told, whole["starts"], took_s, limit_s, whole["turned_back_deg"], whole["current_max_a"])


def swing_s(params: dict) -> float:
    """Returns the period of the rotor's swing about a current of LIM_PHASE_A."""
    pairs, flux_wb = params["MOT_POLE_PAIRS"], 1e-3 * params["MOT_FLUX_MWB"]
    torque_nm = 1.5 * pairs * flux_wb * params["LIM_PHASE_A"]
    return math.tau * math.sqrt(1e-7 * params["MOT_J_GCM2"] / (pairs * torque_nm))


def limit_of(params: dict) -> float:
    return LARGE_LIMIT_S if swing_s(params) > LARGE_SWING_S else LIMIT_S


def drawn(folder: Path, number: int, drive: str) -> Outcome:
    """Starts a random motor of this number, with cogging, friction, a dead time and errors drawn for it.

    R, L and J are stated wrong by up to 30 %, the flux by 10 %.
    """
    draw = random.Random(f"start {number} {drive}")
    motor = draw.choice([motor_of, any_motor])(draw)
    params = motor["params"]
    params |= {"PWM_DEADTIME_NS": draw.choice(DEAD_TIMES_NS), "MOT_J_GCM2": max(0.1, params["MOT_J_GCM2"])}
    if "PWM_FREQ_HZ" not in params:
        params["PWM_FREQ_HZ"] = tune(params)["PWM_FREQ_HZ"]
    tables = drawn_bench(motor)
    torque_nm = 1.5e-3 * params["MOT_POLE_PAIRS"] * params["MOT_FLUX_MWB"] * params["LIM_PHASE_A"]
    tables["bench.motor"] |= {
        "cogging_nm": draw.uniform(0.0, 0.03) * torque_nm,
        "cogging_order": 12 * params["MOT_POLE_PAIRS"],
        "friction_nm": draw.uniform(0.0, 0.01) * torque_nm,
    }
    tables["bench"]["plant"] = draw.choice(PLANTS)
    throttle = IDLE
    if drive == "unknown":
        tables["params"] = FACTORY | {"STA_MODE": 0} | limits(motor)
        # The longest dead times take all that idle throttle gives, at rest and turning.
        throttle = draw.uniform(IDLE, 4 * IDLE)
    else:
        tables["params"] = params | dict.fromkeys([*FROM_MOTOR, "STA_MODE"], 0) | DRIVES[drive]
        tables["bench.scale"] = {key: draw.uniform(0.7, 1.3) for key in "RLJ"} | {"flux": draw.uniform(0.9, 1.1)}
    return started(folder, tables, limit_of(params), throttle)


def main() -> int:
    given = campaign.words(__doc__, motors=500)
    cases = list(product(campaign.numbers(given), DRIVES))
    outcomes = {drive: [] for drive in DRIVES}
    print(f"{'motor':>5} {'drive':<8} {'in time':<7} {'ms':>5} {'starts':>6} {'back':>6} {'A':>6}  faults, warnings")
    for (number, drive), outcome in campaign.played(cases, lambda folder, case: drawn(folder, *case), given.jobs):
        outcomes[drive].append(outcome)
        in_time = "yes" if outcome.is_in_time() else "NO"
        figures = f"{1e3 * outcome.took_s:>5.0f} {outcome.starts:>6} {outcome.back_deg:>6.0f} {outcome.current_a:>6.1f}"
        print(f"{number:>5} {drive:<8} {in_time:<7} {figures}  {', '.join(outcome.told)}".rstrip(), flush=True)
    holds = True
    for drive, of in outcomes.items():
        in_time = sum(outcome.is_in_time() for outcome in of)
        holds &= in_time >= (1 - LATE) * len(of)
        median_ms = 1e3 * statistics.median(outcome.took_s for outcome in of)
        print(f"{drive}: {in_time} of {len(of)} in time, the median after {median_ms:.0f} ms")
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
