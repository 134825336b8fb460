"""Prints the first board's memory and time in one table, from what the steps of `tests/run` have printed: each figure
with its unit, the statistic that it is, and the target. The limits that fail are where the figures are measured.
    budget.py LOGS

Exit status 1 if a figure is not in the logs.
"""

import re
import sys
from pathlib import Path

# What is measured, its unit, the log that has it, and where: the figures are the pattern's groups. Last, for each
# figure, the statistic that it is, and its target.
MEASURED = [
    ("flash", "bytes", "sizes-b-g431b-esc1", r"^flash +(\d+) of", [("", "at most 120832")]),
    ("SRAM", "bytes", "sizes-b-g431b-esc1", r"^SRAM +(\d+) of", [("with the deepest stack", "at most 16896")]),
    ("CCM", "bytes", "sizes-b-g431b-esc1", r"^CCM +(\d+) of", [("", "at most 10240")]),
    (
        "default drive's step, on QEMU",
        "instructions",
        "counts",
        r"^(?:.* )?default: the same bits(?:.*\n)*?all +\d+ +\d+ +(\d+) +(\d+)$",
        [("median", "at most 330"), ("maximum", "at most 625")],
    ),
    (
        "PWM interrupt, on QEMU",
        "instructions",
        "counts",
        r"^(?:.* )?the whole interrupt:(?:.*\n)*?all +\d+ +\d+ +(\d+) +(\d+)$",
        [("median", "at most 460"), ("maximum", "at most 840")],
    ),
    (
        "PWM interrupt, in steady flight",
        "instructions",
        "counts",
        r"^(?:.* )?the whole interrupt:(?:.*\n)*?steady flight +\d+ +\d+ +\d+ +(\d+)$",
        [("maximum", "at most 700")],
    ),
    (
        "longest interrupt at its highest PWM",
        "share of the period",
        "modes",
        r"^six-step, 35 kHz +full throttle +\d+ +\d+ +([\d.]+)$",
        [("six-step at full throttle", "at most 0.70")],
    ),
    (
        "PWM interrupt, on the virtual board",
        "estimated cycles",
        "virtual-board",
        r"^PWM interrupt: .*estimated (\d+) cycles, at most (\d+);",
        [("mean", "at most 800"), ("maximum", "at most 1400")],
    ),
    (
        "emulator's speed, averaged plant",
        "times the yardstick's",
        "bench",
        r"^averaged +[\d.]+ +([\d.]+) ",
        [("median", "at least 0.62")],
    ),
    (
        "emulator's speed, switching plant",
        "times the yardstick's",
        "bench",
        r"^switching +[\d.]+ +([\d.]+) ",
        [("median", "at least 0.24")],
    ),
]


def row(what: str, unit: str, statistic: str, now: str, target: str) -> str:
    """Returns a row of the table."""
    return f"{what:<37}{unit:<20}{statistic:<24}{now:<14}{target}"


def found(logs: Path, log: str, pattern: str, count: int) -> list[str]:
    """Returns this many figures; each as "not measured" if its step has not printed them."""
    path = logs / f"{log}.log"
    match = re.search(pattern, path.read_text(), re.MULTILINE) if path.exists() else None
    return list(match.groups()) if match else ["not measured"] * count


def main() -> int:
    if len(sys.argv) != 2:
        print("usage: budget.py LOGS", file=sys.stderr)
        return 2
    missing = False
    print(row("", "unit", "statistic", "now", "target"))
    for what, unit, log, pattern, figures in MEASURED:
        values = found(Path(sys.argv[1]), log, pattern, len(figures))
        missing |= "not measured" in values
        for value, (statistic, target) in zip(values, figures, strict=True):
            print(row(what, unit, statistic, value, target))
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
