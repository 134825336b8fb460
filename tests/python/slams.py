"""Slams: a throttle that jumps at random between idle and full, on motors stated wrongly, with any of a board's dead
times.

    target/venv/bin/python tests/python/slams.py --motors 20 --steps 150 --jobs 2

plays each of this many random motors in speed and in voltage mode, on both plants, and prints a row for each; it exits
with status 1 if one does not hold.
"""

import random
import statistics
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import campaign
import paths

sys.path.insert(0, str(paths.DIALECT))

from motors import FROM_MOTOR, drawn_bench, flown, motor_of, tune  # noqa: E402  (they need the dialect's folder)

IDLE = 0.055
DEAD_TIMES_NS = [200, 300, 500, 750]
SPEED, VOLTAGE = 0, 2
MODES = {"speed": SPEED, "voltage": VOLTAGE}
PLANTS = ["averaged", "switching"]
TRANSIENT_DEG = 45.0
IDLE_DEG = 20.0


@dataclass(frozen=True)
class Outcome:
    """What slams have done to a drive."""

    told: list
    """Faults and warnings."""
    starts: int
    lost: bool
    """An error of 90 degrees or more."""
    worst_deg: float
    """Largest angle error, from the first step to the end."""
    idle_deg: float
    """The rms error at the end of half a second of idle."""

    def holds(self) -> bool:
        turned_on = not self.told and self.starts == 0 and not self.lost
        return turned_on and self.worst_deg < TRANSIENT_DEG and self.idle_deg < IDLE_DEG


def throttles(draw: random.Random, steps: int) -> tuple[list, float]:
    """Draws throttle steps, 50 to 300 ms apart, a third of them from end to end, then half a second of idle.

    Returns times and throttles, and when it ends.
    """
    at_s, throttle = 1.5, [(0.0, 0.0), (0.5, 0.3)]
    for _ in range(steps):
        share = draw.choice([IDLE, 1.0]) if draw.random() < 1 / 3 else draw.uniform(IDLE, 1.0)
        throttle.append((at_s, share))
        at_s += draw.uniform(0.05, 0.3)
    throttle.append((at_s, IDLE))
    return throttle, at_s + 0.5


def slams_of(told: list, windows: dict) -> Outcome:
    """Returns the outcome from the windows "all" and "idle"."""
    whole = windows["all"]
    # A drive that is off has no error, but knows no angle either.
    worst_deg, idle_deg = whole["angle_error_max_deg"], windows["idle"]["angle_error_rms_deg"]
    known = worst_deg is not None and idle_deg is not None
    errors_deg = (worst_deg, idle_deg) if known else (180.0, 180.0)
    return Outcome(told, whole["starts"], whole["lock_lost"], *errors_deg)


def slammed(folder: Path, draw: random.Random, tables: dict, steps: int) -> Outcome:
    """Plays slams.

    R, L and J are stated wrong by up to 30 %, the flux by 10 %; settings follow from the motor.
    """
    throttle, end_s = throttles(draw, steps)
    dead_time_ns = tables["params"]["PWM_DEADTIME_NS"]
    tables["bench"] |= {"duration_s": end_s, "dead_time_ns": float(dead_time_ns)}
    tables["bench.scale"] = {key: draw.uniform(0.7, 1.3) for key in "RLJ"} | {"flux": draw.uniform(0.9, 1.1)}
    tables["params"] |= dict.fromkeys(FROM_MOTOR, 0)
    windows = {"all": (1.4, end_s), "idle": (end_s - 0.2, end_s)}
    return slams_of(*flown(folder, tables, throttle, windows))


def drawn(folder: Path, number: int, mode: str, plant: str, steps: int) -> Outcome:
    """Slams the random motor of this number, with a dead time and errors drawn for mode and plant."""
    draw = random.Random(f"{number} {mode} {plant}")
    motor = motor_of(random.Random(number))
    params = motor["params"] | {"PWM_DEADTIME_NS": draw.choice(DEAD_TIMES_NS)}
    params |= {"PWM_FREQ_HZ": tune(params)["PWM_FREQ_HZ"], "CTL_MODE": MODES[mode]}
    tables = drawn_bench(motor) | {"params": params}
    tables["bench"]["plant"] = plant
    return slammed(folder, draw, tables, steps)


def main() -> int:
    given = campaign.words(__doc__, motors=20, steps=(150, "steps of the throttle"))
    cases = list(product(campaign.numbers(given), MODES, PLANTS))
    outcomes = []
    print(f"{'motor':>5} {'mode':<8} {'plant':<10} {'held':<5} {'starts':>6} {'worst':>6} {'idle':>5}  faults, warnings")
    for (number, mode, plant), outcome in campaign.played(
        cases, lambda folder, case: drawn(folder, *case, given.steps), given.jobs
    ):
        outcomes.append(outcome)
        held = "yes" if outcome.holds() else "NO"
        figures = f"{outcome.starts:>6} {outcome.worst_deg:>6.1f} {outcome.idle_deg:>5.1f}"
        told = ", ".join(map(str, outcome.told))
        print(f"{number:>5} {mode:<8} {plant:<10} {held:<5} {figures}  {told}".rstrip(), flush=True)
    held = sum(outcome.holds() for outcome in outcomes)
    worst = [outcome.worst_deg for outcome in outcomes]
    idle = [outcome.idle_deg for outcome in outcomes]
    print(f"{held} of {len(outcomes)} hold; degrees, median and most:", end=" ")
    print(f"transient {statistics.median(worst):.1f} and {max(worst):.1f}", end=", ")
    print(f"idle {statistics.median(idle):.1f} and {max(idle):.1f} rms")
    return 0 if held == len(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
