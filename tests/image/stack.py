"""The stack: one for the start, the tasks and all interrupts on top of each other.

Until the control interrupt is started, nothing runs at priority 0 or 1: what takes most stack at the start, creating
the ESC, has the room of those two.
"""

from boards import Board
from calls import FRAME_BYTES, Bound, Calls
from image import Function

WORD = 4
FIRST_VECTORS = 2
"""The initial stack pointer, and the reset."""
HARD_FAULT = 3
"""Its handler restarts the stack."""
BEFORE = tuple(f"siskin_firmware::tasks::start::{name}" for name in ("power_up", "open_port"))
"""Create the ESC and its throttle, return before the control interrupt is started, and are not called again."""
TASK = "embassy_executor::raw::TaskStorage::poll"
THROTTLE = "siskin_firmware::tasks::throttle::Listener::"
"""The throttle's task has an executor of its own, in an interrupt, which runs no other."""


def vectors(calls: Calls) -> list[Function]:
    """Returns the vector table's functions, each once, except for reset and hard fault."""
    image = calls.image
    table = next(s for s in image.sections if s.name == ".vector_table")
    found = {}
    for index in range(FIRST_VECTORS, table.size // WORD):
        function = image.functions.get(image.word(table.begin + index * WORD) & ~1)
        if function and index != HARD_FAULT:
            found[function.begin] = function
    return list(found.values())


def lost_vectors(calls: Calls) -> list[str]:
    """Returns the handlers beyond the table's copy in RAM, which would not be found there."""
    image = calls.image
    table = next(s for s in image.sections if s.name == ".vector_table")
    copied = image.symbols["__ram_vectors_end"] - image.symbols["__ram_vectors"]
    default = image.symbols.get("DefaultHandler", 0) & ~1
    beyond = (image.word(table.begin + at) & ~1 for at in range(copied, table.size, WORD))
    lost = (image.functions.get(target) for target in beyond if target != default)
    return [f"the vector of {f.name} is not copied to RAM: see _ram_vectors" for f in lost if f]


def thread_tasks(calls: Calls) -> frozenset[Function]:
    """Returns the other executor's tasks: none calls anything of the throttle's except through its port."""
    functions = calls.image.functions

    def listens(task):
        called = (functions.get(call.target) for call in calls.code[task.begin].calls)
        return any(f and f.name.startswith(THROTTLE) for f in called)

    return frozenset(f for f in functions.values() if f.name == TASK and not listens(f))


def deepest(calls: Calls, functions: list[Function]) -> Bound:
    """Returns the bound of whichever takes most, including what the processor pushes for it."""
    without = thread_tasks(calls)
    bounds = [calls.bound(function, without=without) for function in functions]
    most = max(bounds, key=lambda bound: bound.size, default=None)
    return Bound(most.size + FRAME_BYTES, most.path) if most else Bound(0, ())


def levels(calls: Calls, board: Board) -> list[tuple[str, Bound]]:
    """Returns what each level takes at most, at the time when the sum is largest."""
    image = calls.image
    named = {name: image.symbols[name] & ~1 for name in (board.pwm, board.alarm) if name}
    handlers = vectors(calls)
    before = frozenset(f for f in image.functions.values() if f.name in BEFORE)
    reset = image.functions[image.symbols["Reset"] & ~1]

    def at(name):
        return [f for f in handlers if f.begin == named.get(name)]

    others = ("other interrupts", deepest(calls, [f for f in handlers if f.begin not in named.values()]))
    alarm = [("gate driver's alarm", deepest(calls, at(board.alarm)))] if board.alarm else []
    start = [("start", calls.bound(reset)), others]
    running = [
        ("tasks", calls.bound(reset, without=before)),
        others,
        *alarm,
        ("PWM interrupt", deepest(calls, at(board.pwm))),
    ]
    return max(start, running, key=lambda levels: sum(bound.size for _, bound in levels))
