"""The report on images as a whole: sizes, and the boards' own images."""

import re
import subprocess
import sys

import pytest
from elftools.dwarf.callframe import FDE
from elftools.elf.elffile import ELFFile

from paths import IMAGE_REPORT, IMAGES, TOOL
from small_image import LEVELS, VECTORS, build

sys.path.insert(0, str(IMAGE_REPORT))

import component  # noqa: E402  (it needs the report's folder)
import sizes  # noqa: E402
from boards import BOARDS  # noqa: E402
from calls import FRAME_BYTES, Calls  # noqa: E402
from image import Image, Unreadable  # noqa: E402
from names import demangled  # noqa: E402

BOARD = BOARDS["b-g431b-esc1"]

def test_without_relocations_nothing_is_said(tmp_path):
    with pytest.raises(Unreadable, match="emit-relocs"):
        Image(build(tmp_path, LEVELS + VECTORS, options=()))


def test_sizes_are_those_of_the_memories(tmp_path):
    image = Image(build(tmp_path, LEVELS + VECTORS))
    # Nine vectors, the code in flash, to which the compiler adds some, and the CCM's 18 bytes in whole words.
    text = next(s.size for s in image.sections if s.name == ".text")
    assert sizes.stored(image, BOARD.flash) == 36 + text + 20
    ccm, sram = BOARD.memories
    assert sizes.used(image, ccm) == 512 + 20
    assert sizes.used(image, sram) == 1024
    rows = dict(sizes.by_module(image, [BOARD.flash, ccm, sram]))
    # Fault 4, Reset 4, SLOW 6, QUICK 6; ADC1_2 12, fast 6.
    assert rows["without a module"] == [20, 18, 0]


@pytest.mark.parametrize(
    ("name", "module"),
    [
        ("siskin_control::drive::step::step", "siskin_control::drive"),
        ("<siskin_units::math::gain::Gain as core::cmp::PartialEq>::eq", "siskin_units::math"),
        ("<&mut heapless::string::String as core::fmt::Write>::write_str", "heapless"),
        ("siskin_firmware::__cortex_m_rt_main", "siskin_firmware"),
        ("_RNvNtNtCs7NhdfSRABLd_17compiler_builtins3mem6memcpy", "compiler_builtins"),
        ("core::fmt::write", "core"),
        ("ADC1_2", "without a module"),
    ],
)
def test_a_name_tells_its_module(name, module):
    assert sizes.module(name) == module


@pytest.mark.parametrize(
    ("legacy", "v0", "name"),
    [
        (
            "_ZN15siskin_firmware9interrupt6period9Interrupt7control17hf41d562fdb85dc23E",
            "_RNvMNtNtCs3qNHHVFI430_15siskin_firmware9interrupt6periodNtB2_9Interrupt7control",
            "siskin_firmware::interrupt::period::Interrupt::control",
        ),
        (
            "_ZN14siskin_control5drive4turn5watch17h6db78d1cc8cf9248E",
            "_RINvNtNtCs6RWeDgMq4dC_14siskin_control5drive4turn5watchNtNtNtB6_7control8observer6ConfigEB6_",
            "siskin_control::drive::turn::watch",
        ),
        (
            "_ZN105_$LT$siskin_control..control..observer..Config$u20$as$u20$siskin_control..control..observer"
            "..Observer$GT$7advance17h20e4fbe98b0ea955E",
            "_RNvXs_NtNtCs6RWeDgMq4dC_14siskin_control7control8observerNtB4_6ConfigNtB4_8Observer7advance",
            "<siskin_control::control::observer::Config as siskin_control::control::observer::Observer>::advance",
        ),
        (
            "_ZN14siskin_control5drive6launch9commanded28_$u7b$$u7b$closure$u7d$$u7d$17h417c90db411156ceE",
            "_RNCNvNtNtCs6RWeDgMq4dC_14siskin_control5drive6launch9commanded0B7_",
            "siskin_control::drive::launch::commanded::{closure}",
        ),
        (
            "__Thumbv7ABSLongThunk__ZN15siskin_firmware10last_words4fail4fail17h0d8db502260d9a5dE",
            "__Thumbv7ABSLongThunk__RNvNtNtCs3qNHHVFI430_15siskin_firmware10last_words4fail4fail",
            "siskin_firmware::last_words::fail::fail",
        ),
    ],
)
def test_both_ways_to_spell_a_name_give_the_same(legacy, v0, name):
    assert demangled([legacy, v0]) == [name, name]


def report(*arguments) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, str(IMAGE_REPORT / "report.py"), *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_the_report_ends_well_or_says_why_not(tmp_path):
    good = report("b-g431b-esc1", build(tmp_path, LEVELS + VECTORS))
    assert good.returncode == 0, good.stdout + good.stderr
    assert "stack at most" in good.stdout

    # There is room for 1 KB, and this alone takes 4.
    greedy = LEVELS.replace("sub sp, #24", "sub sp, #4096").replace("add sp, #24", "add sp, #4096")
    greedy = report("b-g431b-esc1", build(tmp_path, greedy + VECTORS))
    assert greedy.returncode == 1
    over = 8 + FRAME_BYTES + 4096 + FRAME_BYTES + 56 - 1024
    assert f"FAILED: stack at most: {over + 1024} bytes, {over} too many" in greedy.stdout


COMPONENT = LEVELS.replace(
    "push {r4, lr}\n    pop {r4, pc}",
    """push {r4, lr}
    bl mavlink_entrance
    bl shared
    ldr r1, =both
    pop {r4, pc}""",
) + """
    .section .text
    function mavlink_entrance
    push {r4, lr}
    bl private
    bl shared
    ldr r1, =both
    ldr r2, =alone
    ldr r3, =leading
    pop {r4, pc}
    .ltorg
    end mavlink_entrance
    function private
    nop
    bx lr
    end private
    function shared
    nop
    bx lr
    end shared
    .section .rodata, "a", %progbits
    .balign 4
    both: .word 1, 2
    alone: .word 3, 4, 5
    leading: .word led, 6
    led: .word 7
"""


def test_what_is_there_for_one_part_is_told_from_what_others_need_too(tmp_path):
    calls = Calls(Image(build(tmp_path, COMPONENT + VECTORS)))
    functions, data = component.contents(calls, ("mavlink_",))
    assert [function.name for function in functions] == ["mavlink_entrance", "private"]
    assert [end - begin for begin, end in data] == [12, 8, 4]
    entrance, private = (function.size for function in functions)
    assert private == 4
    assert component.size(calls, ("mavlink_",)) == entrance + 4 + 24
    assert component.size(calls, ("nobody_",)) == 0


def test_too_much_is_told_by_memory(tmp_path):
    stuffed = LEVELS + VECTORS + "    .section .rodata\n    .space 130000\n"
    told = report("b-g431b-esc1", build(tmp_path, stuffed))
    assert told.returncode == 1
    assert "FAILED: flash: " in told.stdout and "FAILED: CCM" not in told.stdout
    stuffed = LEVELS + '    .section .control, "ax"\n    .space 9800\n' + VECTORS
    told = report("b-g431b-esc1", build(tmp_path, stuffed))
    assert told.returncode == 1 and "FAILED: CCM: " in told.stdout


def test_bad_input_is_told(tmp_path):
    for arguments in [(), ("b-g431b-esc1",), ("third-board", "x")]:
        told = report(*arguments)
        assert told.returncode == 2 and "usage" in told.stderr
    told = report("b-g431b-esc1", tmp_path / "none")
    assert told.returncode == 1 and "FAILED: " in told.stdout
    text = tmp_path / "text"
    text.write_text("no ELF")
    told = report("b-g431b-esc1", text)
    assert told.returncode == 1 and "FAILED: " in told.stdout and not told.stderr


@pytest.mark.parametrize("board", BOARDS)
def test_the_frames_of_a_board_are_those_that_the_compiler_notes(board):
    path = IMAGES / f"{board}.elf"
    calls = Calls(Image(path))
    compared = 0
    with path.open("rb") as file:
        notes = ELFFile(file).get_dwarf_info(relocate_dwarf_sections=False)
        for entry in notes.CFI_entries():
            begin = entry["initial_location"] & ~1 if isinstance(entry, FDE) else None
            if begin not in calls.code:
                continue
            frames = [row["cfa"] for row in entry.get_decoded().table]
            # Once another register holds the frame, the stack may grow deeper than that.
            by_stack_pointer = all(frame.reg == 13 for frame in frames)
            noted, found = max(frame.offset for frame in frames), calls.code[begin].frame
            assert found == noted if by_stack_pointer else found >= noted, entry
            compared += 1
    assert compared > 100


@pytest.mark.parametrize("board", BOARDS)
def test_the_tool_tells_a_boards_image(board, tmp_path):
    elf = IMAGES / f"{board}.elf"
    told = subprocess.run(
        [TOOL, "image", elf, "--board", board, "--output", tmp_path],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert told.returncode == 0, told.stderr
    assert re.search(rf"^board +{board}$", told.stdout, re.MULTILINE)
    assert re.search(r"^version +\d+\.\d+\.\d+( flight)?$", told.stdout, re.MULTILINE)
    assert re.search(r"^build +([0-9a-f]{16}\+?|unknown)$", told.stdout, re.MULTILINE)
    image = Image(elf)
    contents = (tmp_path / f"{board}.bin").read_bytes()
    assert len(contents) == sizes.stored(image, BOARDS[board].flash)
    vectors = [int.from_bytes(contents[at : at + 4], "little") for at in (0, 4)]
    assert vectors == [image.symbols["_stack_start"], image.symbols["Reset"] | 1]


@pytest.mark.parametrize(("board", "other"), [tuple(BOARDS), tuple(reversed(BOARDS))])
def test_the_tool_refuses_a_boards_image_for_the_other(board, other):
    told = subprocess.run(
        [TOOL, "flash", IMAGES / f"{board}.elf", "--board", other],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (told.returncode, told.stdout) == (2, "")
    assert f"made for {board}, not for {other}" in told.stderr
