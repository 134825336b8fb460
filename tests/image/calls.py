"""An image's call graph, and how much stack it takes."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

import indirect
from image import Function, Image, Unreadable
from machine import Code, code_of

FRAME_BYTES = 26 * 4 + 4
"""What the processor pushes for an interrupt: 26 words with the floating-point unit's, plus up to one that aligns the
stack to 8 bytes."""


@dataclass(frozen=True)
class Bound:
    """The most stack that a function can take, and the calls that lead there."""

    size: int
    path: tuple[Function, ...]


class Calls:
    """The call graph of an image. What it could not make out is in `problems`."""

    def __init__(self, image: Image):
        self.image = image
        self.problems = []
        self.code = {}
        for function in image.functions.values():
            try:
                self.code[function.begin] = code_of(image, function)
            except Unreadable as reason:
                self.problems.append(str(reason))
                self.code[function.begin] = Code()
        self.by_address = self._called_by_address()
        self._bounds = {}

    def _called_by_address(self) -> list[Function]:
        """Returns all functions whose address is stored, outside the vector table, or held by code."""
        stored = {value & ~1 for _, value in self.image.data_addresses() if value & 1}
        held = {use & ~1 for code in self.code.values() for use in code.held() if use & 1}
        found = [self.image.functions[b] for b in sorted(stored | held) if b in self.image.functions]
        for function in found:
            if not indirect.is_foreseen(function.name):
                self.problems.append(f"who calls {function.name} by its address? see indirect.py")
        return found

    def callees(self, function: Function):
        """Yields pairs of the stack in use at a call and the function called."""
        for call in self.code[function.begin].calls:
            if call.target is None:
                targets = [
                    target
                    for target in self.by_address
                    if indirect.may_lead_to(function.name, target.name)
                ]
                if not indirect.may_call(function.name):
                    self.note(f"whom does {function.name} call at {call.site:#x}? see indirect.py")
            else:
                target = self.image.functions.get(call.target)
                targets = [target] if target else []
                if not target:
                    self.note(f"{function.name} calls {call.target:#x}, which is no function")
            for target in targets:
                yield call.depth, target

    def note(self, problem: str):
        if problem not in self.problems:
            self.problems.append(problem)

    def bound(self, function: Function, callers: tuple = (), without: frozenset[Function] = frozenset()) -> Bound:
        """Returns the most stack that it and everything it calls take, except for some that are not called. A
        recursion has no bound and is a problem."""
        if function in callers:
            names = " -> ".join(f.name for f in (*callers[callers.index(function) :], function))
            self.note(f"recursion: {names}")
            return Bound(0, ())
        key = (function, without)
        if key not in self._bounds:
            most = Bound(self.code[function.begin].frame, (function,))
            for depth, callee in self.callees(function):
                if callee in without:
                    continue
                inner = self.bound(callee, (*callers, function), without)
                if depth + inner.size > most.size:
                    most = Bound(depth + inner.size, (function, *inner.path))
            self._bounds[key] = most
        return self._bounds[key]


def path(functions: Iterable[Function]) -> str:
    """Returns the names along a call path, without far jumps, which are named after their targets."""
    names = []
    for function in functions:
        name = re.sub(r"^siskin_", "", function.name)
        if name not in names[-1:]:
            names.append(name)
    return " -> ".join(names)
