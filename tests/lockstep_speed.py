#!/usr/bin/env python3
"""How fast four ESCs in lockstep are, in steps of 1 ms, with the C client on the same core.

Measured in processor time of both programs, which other load on the machine hardly changes.
"""

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "python"))

from lockstep import FOUR, build_example  # noqa: E402
from paths import PROGRAM  # noqa: E402

ONE_CORE = (shutil.which("taskset"), "-c", str(min(os.sched_getaffinity(0))))
SECONDS = 20


def spent_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def times_real_time(example: Path) -> float:
    before_s = spent_s()
    options = ["--speed", "lockstep", "--duration", str(SECONDS), "--mavlink", "none", "--web", "none"]
    options += ["--signal", "udp:127.0.0.1:0", "--storage", "none", "--json"]
    command = [*ONE_CORE, PROGRAM, *map(str, FOUR), *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as emulator:
        port = json.loads(emulator.stdout.readline())["ready"]["signal"].rpartition(":")[2]
        steps = str(1000 * SECONDS)
        subprocess.run([*ONE_CORE, example, port, steps], check=True, capture_output=True, timeout=120)
        emulator.stdout.read()
    return SECONDS / (spent_s() - before_s)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        example = build_example(Path(folder))
        runs = [times_real_time(example) for _ in range(3)]
    print("lockstep, four ESCs, times real time on one core:", *(f"{run:.1f}" for run in runs))


if __name__ == "__main__":
    main()
