"""`siskin image` and `siskin flash` refuse an image whose PWM interrupt needs the flash while that is being written.
The images are small, and linked like the boards'."""

import subprocess

import pytest

from paths import TOOL
from small_image import LEVELS, VECTORS, build

TAG = """
    .section .rodata, "a", %progbits
    .balign 4
    .ascii "SISKIN\\0\\2"
    .ascii "b-g431b-esc1"
    .space 12
    .ascii "0.1.0"
    .space 19
    .ascii "unknown"
    .space 17
    .word 0x08000000, sum, behind, __image_end
    sum: .word 0xffffffff, 0xffffffff
    behind:
"""

FLASH = """
    function Reset
    b Reset
    end Reset
    function SLOW
    bx lr
    end SLOW
    function QUICK
    bx lr
    end QUICK
    function far
    bx lr
    end far
    function never
    bx lr
    end never
    .section .rodata, "a", %progbits
    .balign 4
    .global table
    table: .word 1, 2, 3
"""

INTERRUPT = """
    .section .control, "ax", %progbits
    function ADC1_2
    push {{r7, lr}}
    bl between
    pop {{r7, pc}}
    end ADC1_2
    function between
    push {{r7, lr}}
    {does}
    ldr r1, =0x08000004             // a number that looks like an address
    pop {{r7, pc}}
    .ltorg
    end between
    .balign 4
    {beside}
"""


def tool(image, *command) -> subprocess.CompletedProcess:
    return subprocess.run([TOOL, *command, image], capture_output=True, text=True, timeout=60)


def judge(folder, text) -> subprocess.CompletedProcess:
    image = build(folder, text + TAG + VECTORS)
    return tool(image, "image", "--output", folder / "files")


@pytest.mark.parametrize(
    ("does", "beside", "needs"),
    [
        # The linker makes a veneer for the call: it is far.
        ("bl far", "", "far (ADC1_2 -> between -> far)"),
        ("b far", "", "far (ADC1_2 -> between -> far)"),
        ("ldr r3, =far; blx r3", "", "far (ADC1_2 -> between -> far)"),
        ("movw r3, #:lower16:far; movt r3, #:upper16:far; bx r3", "", "far (ADC1_2 -> between -> far)"),
        ("ldr r3, =table + 4", "", "what between reads at {table4} (ADC1_2 -> between)"),
        (
            "movw r3, #:lower16:table; movt r3, #:upper16:table",
            "",
            "what between reads at {table} (ADC1_2 -> between)",
        ),
        ("ldr r3, [r0]; blx r3", "", "perhaps what between calls by a pointer (ADC1_2 -> between)"),
        # One function's address says nothing about the next call.
        (
            "ldr r3, =between; blx r3; ldr r3, [r0]; blx r3",
            "",
            "perhaps what between calls by a pointer (ADC1_2 -> between)",
        ),
        # Of two addresses in one datum, each register has its own.
        (
            "movw r2, #:lower16:table; movw r3, #:lower16:(table + 4); "
            "movt r2, #:upper16:table; movt r3, #:upper16:(table + 4)",
            "",
            "what between reads at {table} (ADC1_2 -> between), and 1 more;",
        ),
        ("nop", ".word table, between", "{table}, to which the word at"),
    ],
)
def test_what_needs_the_flash_is_refused_with_its_way(does, beside, needs, tmp_path):
    text = FLASH + INTERRUPT.format(does=does, beside=beside)
    told = judge(tmp_path, text)
    assert (told.returncode, told.stdout) == (2, "")
    assert len(told.stderr.splitlines()) == 1
    symbols = subprocess.run(["nm", tmp_path / "image.elf"], capture_output=True, text=True, check=True)
    table = next(int(line.split()[0], 16) for line in symbols.stdout.splitlines() if line.endswith(" table"))
    needs = needs.format(table=f"{table:#010x}", table4=f"{table + 4:#010x}")
    assert f"the PWM interrupt needs from it {needs}" in told.stderr
    assert "firmware/link/sections.x" in told.stderr
    assert not (tmp_path / "files").exists()
    flash = tool(tmp_path / "image.elf", "flash")
    assert (flash.returncode, flash.stderr) == (2, told.stderr)


def test_all_that_it_needs_is_counted(tmp_path):
    does = "bl far; ldr r2, =table + 4; movw r3, #:lower16:table; movt r3, #:upper16:table"
    told = judge(tmp_path, FLASH + INTERRUPT.format(does=does, beside=".word table"))
    assert ", and 3 more; " in told.stderr


def test_what_needs_nothing_is_taken(tmp_path):
    told = judge(tmp_path, LEVELS)
    assert told.returncode == 0, told.stderr
    assert (
        "reach    2 functions, 18 bytes while the flash is written, none of them in it; in any other "
        "period 2, 18 bytes, 0 of them in the flash\n"
    ) in told.stdout


def test_what_cannot_be_judged_is_refused(tmp_path):
    image = build(tmp_path, LEVELS + TAG + VECTORS, options=())
    told = tool(image, "image", "--output", tmp_path / "files")
    assert told.returncode == 2 and "--emit-relocs" in told.stderr
    text, vectors = (part.replace("ADC1_2", "OTHER") for part in (LEVELS, VECTORS))
    image = build(tmp_path, text + TAG + vectors)
    told = tool(image, "image", "--output", tmp_path / "files")
    assert told.returncode == 2 and "no PWM interrupt (ADC1_2)" in told.stderr
