"""Motors on an ESC out of the bag: it knows nothing about the motor, but all of the board's limits and PWM.

    target/venv/bin/python tests/python/out_of_the_bag.py --motors 500 --jobs 2

opens the throttle of each to 30 % and prints a row for each; it exits with status 1 if one neither turns nor is
reported at fault, if one exceeds its limit by more than a fifth, or if more than one in fifty stays at rest.
"""

import random
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path

import campaign
import paths

sys.path.insert(0, str(paths.DIALECT))

from emulator import MOTOR  # noqa: E402  (it needs the dialect's folder)
from motors import FROM_MOTOR, any_motor, drawn_bench, flown  # noqa: E402

FACTORY = {**dict.fromkeys([*MOTOR, *FROM_MOTOR], 0), "CTL_DRIVE": 2}
"""What the default bench sets, at its factory values."""
OPENS_S, SHARE = 0.5, 0.3
END_S = OPENS_S + 3.0
LEAST_SPEED = 0.5
MOST_CURRENT = 1.2
AT_REST = 0.02


@dataclass(frozen=True)
class Outcome:
    """What 3 s of open throttle have done to a motor."""

    told: list
    """Faults and warnings."""
    speed: float
    """The lowest in the last fifth of a second, over the throttle's share of full speed; negative if the wrong way."""
    current: float
    """The largest of a phase, over LIM_PHASE_A."""

    def is_fast(self) -> bool:
        # Half of what a share of the supply gives without the load's losses.
        return self.speed > LEAST_SPEED

    def turns(self) -> bool:
        return not self.told and self.is_fast()

    def holds(self) -> bool:
        """Returns whether it turns and nothing is reported, or does not and something is; within the current."""
        return bool(self.told) != self.is_fast() and self.current < MOST_CURRENT


def limits(motor: dict) -> dict:
    """Returns what is known: about the board and the supply."""
    return {name: value for name, value in motor["params"].items() if name.startswith(("LIM_", "PWM_"))}


def opened(folder: Path, motor: dict, swapped: bool) -> Outcome:
    """Opens a motor's throttle; two of its wires may be swapped, which MOT_DIR has put right."""
    tables = drawn_bench(motor)
    tables["bench"]["duration_s"] = END_S
    tables["params"] = FACTORY | limits(motor) | {"MOT_DIR": int(swapped)}
    windows = {"all": (0.0, END_S), "end": (END_S - 0.2, END_S)}
    told, windows = flown(folder, tables, [(0.0, 0.0), (OPENS_S, SHARE)], windows)
    rpm = -windows["end"]["rpm_max"] if swapped else windows["end"]["rpm_min"]
    current = windows["all"]["current_max_a"] / motor["params"]["LIM_PHASE_A"]
    return Outcome(told, rpm / (SHARE * motor["rpm"]), current)


def drawn(folder: Path, number: int) -> Outcome:
    """Opens the random motor of this number; half of them have two wires swapped."""
    draw = random.Random(f"bag {number}")
    motor = any_motor(draw)
    return opened(folder, motor, draw.random() < 0.5)


def main() -> int:
    given = campaign.words(__doc__, motors=500)
    outcomes = []
    print(f"{'motor':>5} {'turns':<5} {'speed':>6} {'current':>7}  faults, warnings")
    for number, outcome in campaign.played(campaign.numbers(given), drawn, given.jobs):
        outcomes.append(outcome)
        turns = "yes" if outcome.turns() else "NO"
        row = f"{number:>5} {turns:<5} {outcome.speed:>6.2f} {outcome.current:>7.2f}  {', '.join(outcome.told)}"
        print(row.rstrip(), flush=True)
    turn = sum(outcome.turns() for outcome in outcomes)
    hold = sum(outcome.holds() for outcome in outcomes)
    currents = [outcome.current for outcome in outcomes]
    print(f"{turn} of {len(outcomes)} turn, {hold} hold; current over the limit, median and most:", end=" ")
    print(f"{statistics.median(currents):.2f} and {max(currents):.2f}")
    return 0 if hold == len(outcomes) and turn >= (1 - AT_REST) * len(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
