"""Flies Betaflight on four of the emulator's ESCs, and prints the flight's figures.

    target/venv/bin/python tests/flight/fly.py --mode 2 --times 10 --record target/flight.csv

It first builds what it needs of Betaflight, in `target/flight`. Exit status 1 if a bound is broken, or if a flight
differs from the first one by a bit.
"""

import argparse
import contextlib
import csv
import shutil
import signal
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "python"))

import flight
from betaflight import EEPROM
from build import build
from escs import Escs
from judge import Verdict, judge
from plan import Plan
from punch import Punch
from tour import Tour

PLANS = {"tour": Tour, "punch": Punch}


def fly(plan: Plan, mode: int) -> tuple[list[dict], Verdict, str]:
    """Flies a plan once with this `CTL_MODE`; returns what there was at each step, the verdict, and a hash over all of it."""
    with tempfile.TemporaryDirectory() as folder, contextlib.closing(Escs("--param", f"CTL_MODE={mode}")) as escs:
        shutil.copy(EEPROM, folder)
        rows = flight.fly(Path(folder), escs, plan)
        summary = escs.summary()
        return rows, judge(plan, rows, escs.all, summary), flight.hash_of(rows, summary)


def record(plan: Plan, rows: list[dict], path: Path) -> None:
    """Writes a flight as CSV, one line per step."""
    with open(path, "w", newline="") as file:
        table = csv.writer(file)
        rpms = [f"rpm_{esc + 1}" for esc in range(4)]
        table.writerow(["t_s", "height_m", "roll_deg", "pitch_deg", *rpms, "supply_v", "supply_a", "breaks", "event"])
        for row in rows:
            of_body = (row["s"], row["height"], row["roll"], row["pitch"])
            numbers = (*of_body, *row["rpm"], row["supply_v"], row["supply_a"], plan.breaks(row["s"]))
            table.writerow([*(f"{number:.6g}" for number in numbers), plan.event(row["s"])])


def main() -> int:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--plan", choices=PLANS, default="tour", help="which flight (tour)")
    words.add_argument("--mode", type=int, default=2, help="CTL_MODE: 0 speed, 2 voltage (2)")
    words.add_argument("--times", type=int, default=1, help="how many flights (1)")
    words.add_argument("--record", type=Path, help="CSV file for the first one")
    options = words.parse_args()
    # The programs that it has started end with it.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("it was ended"))
    build()
    hashes = []
    broken = False
    for number in range(options.times):
        plan = PLANS[options.plan]()
        rows, verdict, hashed = fly(plan, options.mode)
        hashes.append(hashed)
        broken |= bool(verdict.broken)
        if number == 0:
            print(verdict)
            if options.record:
                record(plan, rows, options.record)
        print(f"flight {number + 1}: hash {hashed}, {len(verdict.broken)} bounds broken")
    return int(broken or len(set(hashes)) > 1)


if __name__ == "__main__":
    sys.exit(main())
