"""What the PWM interrupt needs from the flash while that is written: nothing, since an erase of the
flash stalls whoever reads there for milliseconds.

The interrupt has two ways. While the flash is written it only holds the bridge, which rests then;
in any other period it controls, and may read from the flash what RAM has no room for."""

from boards import Board
from calls import Calls, path
from image import Function


# What the interrupt does not call while the flash is written.
CONTROLS = "siskin_firmware::interrupt::period::Interrupt::control"


def called(calls: Calls, board: Board, writing: bool) -> dict[Function, Function | None]:
    """Every function that the interrupt leads to, each with one that calls it."""
    vector = calls.image.functions[calls.image.symbols[board.pwm] & ~1]
    return calls.reached(vector, CONTROLS if writing else None)


def in_flash(calls: Calls, board: Board) -> list[str]:
    """A line for each function and each datum in the flash that the interrupt leads to, and for its
    vector."""
    image = calls.image
    found = []
    if image.symbols["__ram_vectors"] in board.flash:
        found.append("the vector table")
    callers = called(calls, board, writing=True)
    for function in callers:
        if function.begin in board.flash:
            found.append(f"{way(callers, function)}, {function.size} bytes")
        for use in sorted(set(calls.code[function.begin].uses.values())):
            # An odd one is a function, which is called or stored for later.
            if use in board.flash and use & ~1 not in image.functions:
                found.append(f"{way(callers, function)} reads {use:#x}")
    # Its data stand beside its code, and may lead on.
    homes = {image.section_at(function.begin).name for function in callers}
    for place, value in image.data_addresses():
        if image.section_at(place).name in homes and place not in board.flash and value in board.flash:
            found.append(f"the word at {place:#x} leads to {value:#x}")
    return found


def way(callers: dict, function) -> str:
    """How the interrupt comes to a function."""
    functions = []
    while function:
        functions.append(function)
        function = callers[function]
    return path(reversed(functions))
