"""How large an image is: by memory, and by the source's modules."""

import re
from collections import Counter

from boards import Board, Region
from image import Image

OWN = "siskin_"
"""How the crates broken down by module begin."""


def stored(image: Image, flash: Region) -> int:
    """Returns the bytes of flash, including gaps."""
    return max((begin + size for begin, size in image.loaded), default=flash.begin) - flash.begin


def used(image: Image, memory: Region) -> int:
    """Returns the bytes of a memory, up to the end of the last section in it."""
    ends = [s.end for s in image.sections if s.begin in memory]
    return max(ends, default=memory.begin) - memory.begin


def module(name: str) -> str:
    """Returns a function's crate, with the module if it is one of our own."""
    # `<a::B as c::D>::e` belongs to a, and so does `<&mut a::B>::e`.
    path = re.search(r"[A-Za-z_]\w*(?:::\w+)*", re.sub(r"^<*(?:&|mut |\*const )*", "", name))
    parts = path.group().split("::") if path else [name]
    raw = re.match(r"_R.*?C\w*?_\d+(compiler_builtins|core)", name)
    if raw:
        return raw.group(1)
    if len(parts) == 1:
        return "without a module"
    return "::".join(parts[:2]) if parts[0].startswith(OWN) and len(parts) > 2 else parts[0]


def by_module(image: Image, regions: list[Region]) -> list[tuple[str, list[int]]]:
    """Returns each module's code in each region, largest first."""
    sizes = {region.name: Counter() for region in regions}
    for function in image.functions.values():
        region = next(r for r in regions if function.begin in r)
        sizes[region.name][module(function.name)] += function.size
    names = {name for counter in sizes.values() for name in counter}
    rows = [(name, [sizes[r.name][name] for r in regions]) for name in names]
    return sorted(rows, key=lambda row: (-sum(row[1]), row[0]))


def sections(image: Image, board: Board) -> list[tuple[str, str, int]]:
    """Returns memory, name and size of every section."""
    regions = [board.flash, *board.memories]
    return [
        (next((r.name for r in regions if s.begin in r), "?"), s.name, s.size)
        for s in image.sections
    ]
