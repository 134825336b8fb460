"""The first board's memory and time in one table, from what the steps of `tests/run` have printed: the current
figures, and the targets. The bounds that fail are where the figures are measured.
    budget.py LOGS

Exit status 1 if a figure is not in the logs.
"""

import re
import sys
from pathlib import Path

# Name, the log that has it, and where: the figures are the pattern's groups. Last, the target.
ROWS = [
    ("flash, bytes", "sizes-b-g431b-esc1", r"^flash +(\d+) of", "at most 98304"),
    ("SRAM with the worst stack, bytes", "sizes-b-g431b-esc1", r"^SRAM +(\d+) of", "at most 16384"),
    ("CCM, bytes", "sizes-b-g431b-esc1", r"^CCM +(\d+) of", "at most 9216"),
    (
        "step of the default drive, instructions: median, most",
        "counts",
        r"^(?:.* )?default: the same bits(?:.*\n)*?all +\d+ +\d+ +(\d+) +(\d+)$",
        "at most 330, 500",
    ),
    (
        "whole interrupt, instructions: median, most",
        "counts",
        r"^(?:.* )?the whole interrupt:(?:.*\n)*?all +\d+ +\d+ +(\d+) +(\d+)$",
        "at most 470, 750",
    ),
    (
        "whole interrupt, estimated cycles: mean, most",
        "virtual-board",
        r"^PWM interrupt: .*estimated (\d+) cycles, at most (\d+);",
        "at most 800, 1400",
    ),
    (
        "emulator, of the yardstick: averaged, switching",
        "bench",
        r"^averaged +[\d.]+ +([\d.]+) (?:.*\n)*?switching +[\d.]+ +([\d.]+) ",
        "at least 0.62, 0.24",
    ),
]


def row(logs: Path, log: str, pattern: str) -> str | None:
    """Returns a row's figures; `None` if its step has not printed them."""
    path = logs / f"{log}.log"
    found = re.search(pattern, path.read_text(), re.MULTILINE) if path.exists() else None
    return found and ", ".join(found.groups())


def main() -> int:
    if len(sys.argv) != 2:
        print("usage: budget.py LOGS", file=sys.stderr)
        return 2
    missing = 0
    print(f"{'':<55}{'now':<16}wanted")
    for name, log, pattern, wanted in ROWS:
        figures = row(Path(sys.argv[1]), log, pattern)
        missing += figures is None
        print(f"{name:<55}{figures or 'not measured':<16}{wanted}")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
