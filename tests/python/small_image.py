"""Small images in assembly, linked for the chip, for testing the report on images."""

import os
import subprocess
from pathlib import Path

from paths import IMAGE_REPORT

SOURCES = IMAGE_REPORT / "small"

HEAD = """
    .syntax unified
    .macro function name
    .thumb_func
    .global \\name
    .type \\name, %function
    \\name:
    .endm
    .macro end name
    .size \\name, . - \\name
    .endm
    .section .text, "ax", %progbits
    function Fault
    b Fault
    end Fault
"""


VECTORS = """
    .section .vector_table, "a", %progbits
    .word _stack_start, Reset, Fault, Fault, Fault, Fault, ADC1_2, SLOW, QUICK
"""

LEVELS = """
    function Reset                  // 8
    push {r4, lr}
    pop {r4, pc}
    end Reset
    function SLOW                   // 24
    sub sp, #24
    add sp, #24
    bx lr
    end SLOW
    function QUICK                  // 4
    push {r4}
    pop {r4}
    bx lr
    end QUICK
    .section .control, "ax", %progbits
    function ADC1_2                 // 40, and 16 below
    push {r7, lr}
    sub sp, #32
    bl fast
    add sp, #32
    pop {r7, pc}
    end ADC1_2
    function fast
    sub sp, #16
    add sp, #16
    bx lr
    end fast
"""


def build(
    folder: Path,
    text: str,
    options: tuple[str, ...] = ("--emit-relocs",),
    script: Path = SOURCES / "link.x",
) -> Path:
    """Builds an image from `text`, which begins in flash, defines `Reset`, and may lay out further sections: with the
    small script `.control`, which goes to fast memory, `.rodata`, and `.vector_table`."""
    assembly, image = folder / "text.s", folder / "image.elf"
    assembly.write_text(HEAD + text)
    arguments = [f"-T{script}", "--nmagic", *options]
    subprocess.run(
        [
            *("rustc", "--edition=2024", "--target=thumbv7em-none-eabihf", "-Cpanic=abort"),
            *(f"-Clink-arg={argument}" for argument in arguments),
            *("-o", image, SOURCES / "main.rs"),
        ],
        env={**os.environ, "ASSEMBLY": str(assembly)},
        check=True,
        capture_output=True,
        text=True,
        timeout=120,
    )
    return image
