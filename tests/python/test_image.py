"""The report on images: the stack of small ones, known to the byte."""

import sys

import pytest

from paths import IMAGE_REPORT
from small_image import LEVELS, VECTORS, build

sys.path.insert(0, str(IMAGE_REPORT))

import indirect  # noqa: E402  (it needs the report's folder)
import stack  # noqa: E402
from boards import BOARDS  # noqa: E402
from calls import FRAME_BYTES, Calls  # noqa: E402
from image import Image  # noqa: E402

BOARD = BOARDS["b-g431b-esc1"]

ONE_OF_EACH = """
    function leaf                   // 8
    push {r4, lr}
    pop {r4, pc}
    end leaf

    function saves                  // 20 + 16 + 40, and a leaf below
    push {r4, r5, r6, r7, lr}
    vpush {d8, d9}
    sub sp, #40
    bl leaf
    add sp, #40
    vpop {d8, d9}
    pop {r4, r5, r6, r7, pc}
    end saves

    function large                  // 8 + 5000, by a register
    push {r7, lr}
    movw r3, #5000
    sub sp, sp, r3
    movw r3, #5000
    add sp, sp, r3
    pop {r7, pc}
    end large

    function shrunk                 // 0 or 12, by the way that it takes
    cbz r0, 1f
    push {r4, r5, lr}
    bl leaf
    pop {r4, r5, lr}
1:  bx lr
    end shrunk

    function handed_on              // 16, and then only what it hands on to
    push {r4, r5, r6, lr}
    pop {r4, r5, r6, lr}
    b large
    end handed_on

    function aligned                // 8 + 24 + up to 16 more
    push {r7, lr}
    mov r7, sp
    sub.w r4, sp, #24
    bfc r4, #0, #4
    mov sp, r4
    bl leaf
    mov sp, r7
    pop {r7, pc}
    end aligned

    function chooses                // by a jump table: 0, 4 or 24
    cmp r0, #3
    bhs 9f
    tbb [pc, r0]
8:  .byte (1f - 8b) / 2, (2f - 8b) / 2, (3f - 8b) / 2
    .balign 2
1:  push {r4}
    pop {r4}
    bx lr
2:  sub sp, #24
    add sp, #24
9:  bx lr
3:  b saves
    end chooses

    function beside                 // by a jump table with a constant behind it, which leads nowhere: 0 or 24
    ldr r1, 7f
    tbb [pc, r0]
8:  .byte (1f - 8b) / 2, (2f - 8b) / 2
    .balign 4
7:  .byte (3f - 8b) / 2, (3f - 8b) / 2, (3f - 8b) / 2, (3f - 8b) / 2
1:  bx lr
2:  sub sp, #24
    add sp, #24
    bx lr
3:  sub sp, #400
    add sp, #400
    bx lr
    end beside

    function conditional            // 12: the pop may not happen
    push {r4, r5, lr}
    cmp r0, #0
    it eq
    popeq {r4, r5, pc}
    bl leaf
    pop {r4, r5, pc}
    end conditional

    function stores                 // 16: a push and a store that moves the pointer
    push {r4, lr}
    strd r2, r3, [sp, #-8]!
    ldrd r2, r3, [sp], #8
    pop {r4, pc}
    end stores

    function ends                   // 8: behind the call, which does not return, is no code
    push {r7, lr}
    bl Reset
    .balign 4
    .word 0xffffffff
    end ends

    function Reset
    b Reset
    end Reset
"""


@pytest.fixture(scope="module")
def one_of_each(tmp_path_factory) -> Calls:
    return Calls(Image(build(tmp_path_factory.mktemp("image"), ONE_OF_EACH)))


def named(calls: Calls, name: str):
    return calls.image.functions[calls.image.symbols[name] & ~1]


@pytest.mark.parametrize(
    ("name", "frame", "bound"),
    [
        ("leaf", 8, 8),
        ("saves", 76, 84),
        ("large", 5008, 5008),
        ("shrunk", 12, 20),
        ("handed_on", 16, 5008),
        ("beside", 24, 24),
        ("aligned", 48, 56),
        ("chooses", 24, 84),
        ("conditional", 12, 20),
        ("stores", 16, 16),
        ("ends", 8, 8),
    ],
)
def test_a_function_takes_the_stack_that_it_pushes(one_of_each, name, frame, bound):
    assert one_of_each.problems == []
    function = named(one_of_each, name)
    assert one_of_each.code[function.begin].frame == frame
    assert one_of_each.bound(function).size == bound
    assert one_of_each.problems == []


def test_the_deepest_way_is_named(one_of_each):
    path = one_of_each.bound(named(one_of_each, "chooses")).path
    assert [function.name for function in path] == ["chooses", "saves", "leaf"]


def test_the_levels_stand_on_each_other_and_equals_do_not(tmp_path):
    calls = Calls(Image(build(tmp_path, LEVELS + VECTORS)))
    levels = {name: bound.size for name, bound in stack.levels(calls, BOARD)}
    assert levels == {
        "tasks": 8,
        "other interrupts": FRAME_BYTES + 24,
        "PWM interrupt": FRAME_BYTES + 56,
    }
    assert calls.problems == []


RECURSION = """
    function first
    push {r4, lr}
    bl second
    pop {r4, pc}
    end first
    function second
    cbz r0, 1f
    b first
1:  bx lr
    end second
    function Reset
    b first
    end Reset
"""


def test_a_recursion_is_refused(tmp_path):
    calls = Calls(Image(build(tmp_path, RECURSION)))
    calls.bound(named(calls, "Reset"))
    assert calls.problems == ["recursion: first -> second -> first"]


INDIRECT = """
    function caller                 // 8
    push {r4, lr}
    ldr r3, [r0, #4]
    blx r3
    pop {r4, pc}
    end caller
    function listed                 // 32
    sub sp, #32
    add sp, #32
    bx lr
    end listed
    function handed                 // 64
    sub sp, #64
    add sp, #64
    bx lr
    end handed
    function Reset
    movw r0, #:lower16:handed
    movt r0, #:upper16:handed
    b caller
    end Reset
    .section .rodata, "a", %progbits
    .word 0, listed
"""


def test_a_call_by_an_address_needs_a_line(tmp_path, monkeypatch):
    image = Image(build(tmp_path, INDIRECT))
    calls = Calls(image)
    calls.bound(named(calls, "Reset"))
    assert {problem.split(" ")[2] for problem in calls.problems} == {"listed", "handed", "caller"}

    monkeypatch.setattr(indirect, "LEADS_TO", [("^caller$", "^listed$"), ("^caller$", "^handed$")])
    calls = Calls(image)
    assert calls.bound(named(calls, "Reset")).size == 8 + 64
    monkeypatch.setattr(indirect, "LEADS_TO", [("^caller$", "^listed$")])
    monkeypatch.setattr(indirect, "NEVER_CALLED", ["^handed$"])
    assert calls.bound(named(calls, "Reset")).size == 8 + 64, "it is known by now"
    calls = Calls(image)
    assert calls.bound(named(calls, "Reset")).size == 8 + 32
    assert calls.problems == []


ENDLESS = """
    function Reset
1:  push {r4}
    b 1b
    end Reset
"""

STRANGE = """
    function Reset
    mov sp, r0
    bx lr
    end Reset
"""


@pytest.mark.parametrize(
    ("text", "complaint"), [(ENDLESS, "stack without end"), (STRANGE, "not understood: mov sp, r0")]
)
def test_what_cannot_be_made_out_is_told(tmp_path, text, complaint):
    problems = Calls(Image(build(tmp_path, text))).problems
    assert len(problems) == 1 and complaint in problems[0] and "Reset" in problems[0]
