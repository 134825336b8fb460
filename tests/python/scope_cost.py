"""What a viewer of the page costs the simulation, in processor time of the simulating thread.

    target/venv/bin/python tests/python/scope_cost.py

Other programs on the machine change how long a run takes, but hardly how much work it is. The motor rests: there a
control period takes least, so reading its trace has the largest share.
"""

import json
import os
import statistics
import subprocess
import sys
import time

import paths

sys.path.insert(0, str(paths.DIALECT))

from browser import Browser  # noqa: E402  (it needs the dialect's folder)
from emulator import free_port  # noqa: E402

SIMULATED_S = 150
RUNS = 5


def work(viewed: bool) -> float:
    """Returns the simulating thread's processor seconds per simulated second."""
    port = free_port()
    options = ["--speed", "max", "--duration", str(SIMULATED_S), "--web", f"127.0.0.1:{port}", "--mavlink", "none"]
    options += ["--signal", "udp:127.0.0.1:0", "--storage", "none", "--json"]
    program = subprocess.Popen([str(paths.PROGRAM), *options], stdout=subprocess.PIPE)
    with Browser() as browser:
        if viewed:
            browser.open(f"http://127.0.0.1:{port}/")
        ticks = 0
        while program.poll() is None:
            with open(f"/proc/{program.pid}/task/{program.pid}/stat") as stat:
                user, system = stat.read().rpartition(")")[2].split()[11:13]
            ticks = max(ticks, int(user) + int(system))
            time.sleep(0.01)
    simulated_s = json.loads(program.stdout.read().splitlines()[-1])["sim_s"]
    return ticks / os.sysconf("SC_CLK_TCK") / simulated_s


def main():
    # Alternating, so that both have the same machine.
    pairs = [(work(False), work(True)) for _ in range(RUNS)]
    alone, viewed = (statistics.median(runs) for runs in zip(*pairs))
    print(f"alone {alone * 1e3:.2f} ms, viewed {viewed * 1e3:.2f} ms a simulated second: {viewed / alone - 1:+.1%}")


if __name__ == "__main__":
    main()
