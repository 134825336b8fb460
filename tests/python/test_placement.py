"""The firmware's linker script: the same functions go to RAM however a compiler mangles their names, and a script that
no longer finds them does not link."""

import subprocess

import pytest
from elftools.elf.elffile import ELFFile

from paths import ROOT
from small_image import build

LINK = ROOT / "firmware" / "link"

REQUIRED = {
    ("siskin_firmware", "interrupt", "period", "Interrupt", "hold"): ".control",
    ("siskin_control", "drive", "step", "outer_loop_slice"): ".control",
    ("siskin_control", "drive", "foc", "outer_loop", "supply"): ".control",
    ("siskin_control", "drive", "foc", "current_loop", "limited"): ".control",
    ("siskin_control", "control", "modulator", "Supply", "update_limits"): ".control",
    ("siskin_firmware", "interrupt", "overruns", "Overruns", "note"): ".control_more",
    ("siskin_firmware", "exchange", "word", "pack"): ".control_more",
    ("siskin_control", "protection", "bound"): ".control_more",
    ("siskin_control", "control", "observer", "compensated", "schedule_gains"): ".control",
    ("core", "panicking", "panic"): ".control_more",
    ("__rustc", "rust_begin_unwind"): ".control_more",
    ("siskin_firmware", "last_words", "fail", "fail"): ".control_more",
    ("siskin_firmware", "handlers", "hard_fault"): ".control_more",
    ("cortex_m", "peripheral", "scb", "SCB", "sys_reset"): ".control_more",
}
"""Functions without which no image links."""

OTHERS = {
    ("siskin_units", "math", "gain", "parts"): (".once", 0x200),
    ("siskin_firmware", "interrupt", "pwm", "Pwm", "start"): (".once", 4),
    ("siskin_firmware", "interrupt", "pwm", "Pwm", "change"): (".once", 4),
    ("siskin_firmware", "interrupt", "pwm", "Pwm", "second"): (".control", 4),
    ("siskin_firmware", "interrupt", "leg", "Leg", "compare"): (".control", 4),
    ("siskin_firmware", "exchange", "ends", "ConfigWriter", "write"): (".once", 4),
    ("siskin_control", "drive", "foc", "outer_loop", "reference"): (".control", 0x1800),
    ("siskin_units", "math", "root", "leg"): (".control_more", 0x800),
    ("siskin_control", "drive", "foc", "period", "start"): (".control_rest", 0x5000),
    ("siskin_control", "control", "speed", "Config", "preset"): (".control_rest", 4),
    ("siskin_control", "build", "build"): (".text", 4),
}
"""Others, with their sizes in bytes."""


def legacy(path) -> str:
    return "_ZN" + "".join(f"{len(name)}{name}" for name in path) + "17h0123456789abcdefE"


def v0(path) -> str:
    """Mangles a path; a method is within its type, which takes the module's place."""
    crate, *modules, last = path
    type_ = modules.pop() if modules and modules[-1][0].isupper() else None
    within = "Nt" * len(modules) + f"Cs6RWeDgMq4dC_{len(crate)}{crate}"
    within += "".join(f"{len(name)}{name}" for name in modules)
    if type_:
        within = f"M{within}NtB2_{len(type_)}{type_}"
    return f"_RNv{within}{len(last)}{last}"


def code(spelled: dict[str, int]) -> str:
    """Returns functions of these sizes, all held by the start."""
    text = """
    .section .text.Reset, "ax"
    function Reset
    b Reset
    .balign 4
""" + "".join(f"    .word {symbol}\n" for symbol in spelled) + """
    .word state
    end Reset
    .global DefaultHandler
    .thumb_set DefaultHandler, Fault
    .section .vector_table.exceptions, "a"
    .global __RESET_VECTOR, __EXCEPTIONS, __INTERRUPTS, IMAGE
    __RESET_VECTOR: __EXCEPTIONS: __INTERRUPTS: IMAGE: .space 0x80
    .section .control_state, "aw", %nobits
    state: .space 0x400
"""
    for symbol, size in spelled.items():
        text += f"""
    .section .text.{symbol}, "ax", %progbits
    function {symbol}
    .space {size}
    end {symbol}
"""
    return text


def link(folder, spelled: dict[str, int]):
    (folder / "device.x").write_text("")
    options = ("--emit-relocs", f"-L{LINK}", f"-L{folder}")
    return build(folder, code(spelled), options, LINK / "stm32g431.x")


@pytest.mark.parametrize("spell", [legacy, v0])
def test_both_ways_to_spell_a_name_give_the_same_places(spell, tmp_path):
    spelled = {spell(path): 4 for path in REQUIRED} | {
        spell(path): size for path, (_, size) in OTHERS.items()
    }
    wanted = {spell(path): section for path, section in REQUIRED.items()} | {
        spell(path): section for path, (section, _) in OTHERS.items()
    }
    with link(tmp_path, spelled).open("rb") as file:
        elf = ELFFile(file)
        found = {
            symbol.name: elf.get_section(symbol["st_shndx"]).name
            for symbol in elf.get_section_by_name(".symtab").iter_symbols()
            if symbol.name in wanted
        }
    assert found == wanted


@pytest.mark.parametrize("renamed", REQUIRED, ids="::".join)
def test_a_module_by_another_name_does_not_link(renamed, tmp_path):
    spelled = {v0(path): 4 for path in REQUIRED if path != renamed} | {
        v0(path): size for path, (_, size) in OTHERS.items() if path[:3] != renamed[:3]
    }
    spelled[v0(("siskin_control", "renamed", "function"))] = 0x1800
    with pytest.raises(subprocess.CalledProcessError) as failed:
        link(tmp_path, spelled)
    assert "link/sections.x finds no code of" in failed.value.stderr


@pytest.mark.parametrize("lost", [".once", ".control", ".control_more", ".control_rest"])
def test_a_section_that_has_lost_most_of_its_code_does_not_link(lost, tmp_path):
    spelled = {v0(path): 4 for path in REQUIRED} | {
        v0(path): 4 if section == lost else size for path, (section, size) in OTHERS.items()
    }
    with pytest.raises(subprocess.CalledProcessError) as failed:
        link(tmp_path, spelled)
    assert "link/sections.x no longer finds" in failed.value.stderr
