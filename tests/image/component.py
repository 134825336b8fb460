"""What an image holds for MAVLink: the component's functions, and the functions and data that nothing else leads to.

The component's entrances are never inlined, so its code is found by name; what the compiler has inlined into it is its
own. Data have no names: each extends from an address that something holds to the next."""

import bisect
from collections import defaultdict

from calls import Calls
from image import Function

MAVLINK = ("siskin_control::mavlink::", "mavlink_core::", "sha2::", "<sha2::")
"""How the names of the component's functions begin."""

PARTS = {
    "files": ("siskin_control::mavlink::ftp::",),
    "signatures": ("siskin_control::mavlink::signing::", "sha2::", "<sha2::"),
}
"""Parts of it that are counted separately, likewise. What the compiler has inlined into others counts there."""


def size(calls: Calls, names: tuple[str, ...]) -> int:
    """Returns the bytes of text and data."""
    functions, data = contents(calls, names)
    return sum(function.size for function in functions) + sum(end - begin for begin, end in data)


def contents(calls: Calls, names: tuple[str, ...]) -> tuple[list[Function], list[tuple[int, int]]]:
    """Returns the functions whose names begin like this and what only they lead to: functions, and start and end of
    each piece of data."""
    image = calls.image
    functions = image.functions
    held = {begin: {*code.uses.values(), *(c.target for c in code.calls if c.target is not None)}
            for begin, code in calls.code.items()}
    stored = list(image.data_addresses())
    targets = {use for uses in held.values() for use in uses} | {value for _, value in stored}
    pieces = sorted(target for target in targets if target & ~1 not in functions and image.section_at(target))

    def node(address: int) -> int | None:
        """Returns the start of the function or piece of data that an address belongs to."""
        if address & ~1 in functions:
            return address & ~1
        index = bisect.bisect_right(pieces, address) - 1
        return pieces[index] if index >= 0 else None

    leads = defaultdict(set)
    for begin, uses in held.items():
        leads[begin] |= {node(use) for use in uses}
    for place, value in stored:
        leads[node(place)].add(node(value))

    own = {begin for begin, function in functions.items() if function.name.startswith(names)}
    from_own = reached(leads, own)
    # What the component does not lead to is not its own, nor is what that leads to without it.
    others = reached(leads, set(functions) - from_own, own)
    found = from_own - others
    begins = sorted({*pieces, *functions})
    data = []
    for begin in sorted(found & set(pieces)):
        section = image.section_at(begin)
        if section.bits is not None:
            next_ = begins[bisect.bisect_right(begins, begin) :][:1]
            data.append((begin, min(section.end, *next_)))
    return [functions[begin] for begin in sorted(found & set(functions))], data


def reached(leads: dict, roots: set[int], without: frozenset | set = frozenset()) -> set[int]:
    """Returns everything that these lead to, themselves included, but not by way of `without`."""
    found, waiting = set(roots), list(roots)
    while waiting:
        for next_ in leads.get(waiting.pop(), ()):
            if next_ not in found and next_ not in without and next_ is not None:
                found.add(next_)
                waiting.append(next_)
    return found
