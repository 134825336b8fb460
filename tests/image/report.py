"""Sizes and stack of a linked image, against what its board allows. What its PWM interrupt reaches is judged by
`siskin image`.

    report.py BOARD ELF

Exit status 1 if anything is too large or cannot be made out.
"""

import sys
from pathlib import Path

import component
import sizes
import stack
from boards import BOARDS, MAVLINK, Board
from calls import Calls, path
from image import Image, Unreadable


def limited(name: str, size: int, limit: int, problems: list[str]) -> str:
    """Returns a line with a size and its limit."""
    if size > limit:
        problems.append(f"{name}: {size} bytes, {size - limit} too many")
    return f"{name:<24}{size:>8} of {limit:>7} bytes"


def report(board: Board, image: Image) -> list[str]:
    """Prints the report; returns what is wrong."""
    problems = []
    regions = [board.flash, *board.memories]
    print(limited("flash", sizes.stored(image, board.flash), board.flash.limit, problems))
    for memory in board.memories:
        print(limited(memory.name, sizes.used(image, memory), memory.limit, problems))
    for memory, name, size in sizes.sections(image, board):
        print(f"  {memory:<6}{name:<18}{size:>6}")

    print(f"{'code by module':<32}" + "".join(f"{region.name:>8}" for region in regions))
    for name, row in sizes.by_module(image, regions):
        print(f"  {name:<30}" + "".join(f"{size or '':>8}" for size in row))

    calls = Calls(image)
    parts = {name: component.size(calls, names) for name, names in component.PARTS.items()}
    rest = component.size(calls, component.MAVLINK) - sum(parts.values())
    print(limited("MAVLink component", rest, MAVLINK, problems))
    for name, size in parts.items():
        print(f"  its {name:<20}{size:>8}")

    levels = stack.levels(calls, board)
    room = image.symbols["_stack_start"] - image.symbols["_stack_end"]
    print(limited("stack at most", sum(b.size for _, b in levels), room, problems))
    for name, bound in levels:
        print(f"  {name:<22}{bound.size:>8}  {path(bound.path)}")
    return problems + stack.lost_vectors(calls) + calls.problems


def main() -> int:
    if len(sys.argv) != 3 or sys.argv[1] not in BOARDS:
        print(f"usage: report.py {'|'.join(BOARDS)} ELF", file=sys.stderr)
        return 2
    try:
        problems = report(BOARDS[sys.argv[1]], Image(Path(sys.argv[2])))
    except (Unreadable, OSError) as reason:
        problems = [str(reason)]
    for problem in problems:
        print(f"FAILED: {problem}")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
