#!/usr/bin/env python3
"""How fast the Python module is: four ESCs in steps of 1 ms, with their states read in each; and scenarios, next to
the program's.

Measured in processor time, which other load on the machine hardly changes.
"""

import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import siskin

sys.path.insert(0, str(Path(__file__).parent / "python"))

from paths import PROGRAM, SCENARIOS  # noqa: E402

SECONDS = 5
DRIVES = SCENARIOS / "random-drives.toml"
SEEDS = range(1, 11)


def lockstep(read: bool, **keys: object) -> float:
    """Returns simulated seconds per second of processor time."""
    emulator = siskin.Emulator("bosso", escs=4, bus="6s", **keys)
    emulator.advance(0.4)
    emulator.throttle[:] = 0.5
    emulator.advance(1.6)
    began_s = time.process_time()
    for _ in range(1000 * SECONDS):
        emulator.advance(0.001)
        if read:
            emulator.state
    return SECONDS / (time.process_time() - began_s)


def by_module() -> float:
    began_s = time.process_time()
    siskin.sweep(DRIVES, seeds=SEEDS, threads=1)
    return time.process_time() - began_s


def by_program() -> float:
    def spent_s() -> float:
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        return used.ru_utime + used.ru_stime

    before_s = spent_s()
    command = [PROGRAM, "scenario", DRIVES, "--seeds", f"{SEEDS[0]}..{SEEDS[-1]}"]
    subprocess.run(command, env={**os.environ, "RAYON_NUM_THREADS": "1"}, check=True, capture_output=True)
    return spent_s() - before_s


def main() -> None:
    slow = {"PWM_FREQ_HZ": 15000}
    for name, runs in [
        ("24 kHz", [lockstep(False) for _ in range(3)]),
        ("24 kHz, states read", [lockstep(True) for _ in range(3)]),
        ("15 kHz, states read", [lockstep(True, params=slow) for _ in range(3)]),
    ]:
        print(f"module, four ESCs at {name}, times real time on one core:", *(f"{run:.1f}" for run in runs))
    shares = [by_program() / by_module() for _ in range(3)]
    print("scenarios by the module, speed over that of the program:", *(f"{share:.2f}" for share in shares))


if __name__ == "__main__":
    main()
