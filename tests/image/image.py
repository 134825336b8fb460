"""A linked image: its sections, functions, and which words are addresses."""

import bisect
from dataclasses import dataclass
from pathlib import Path

from elftools.common.exceptions import ELFError
from elftools.elf.elffile import ELFFile

from names import demangled

SHF_ALLOC = 2


class Unreadable(Exception):
    """An image that cannot be judged, and why."""


@dataclass(frozen=True)
class Section:
    """A part of the memory."""

    name: str
    begin: int
    size: int
    bits: bytes | None
    """Its contents; `None` if it only takes room."""

    @property
    def end(self) -> int:
        return self.begin + self.size


@dataclass(frozen=True)
class Function:
    """A function's place, without the Thumb bit."""

    name: str
    begin: int
    size: int

    @property
    def end(self) -> int:
        return self.begin + self.size


class Image:
    """An ELF file linked with `--emit-relocs`, which keeps what refers to what."""

    def __init__(self, path: Path):
        with path.open("rb") as file:
            try:
                elf = ELFFile(file)
            except ELFError as reason:
                raise Unreadable(f"{path} is no image: {reason}") from None
            self.sections = [
                Section(
                    section.name,
                    section["sh_addr"],
                    section["sh_size"],
                    None if section["sh_type"] == "SHT_NOBITS" else section.data(),
                )
                for section in elf.iter_sections()
                if section["sh_flags"] & SHF_ALLOC and section["sh_size"]
            ]
            self.loaded = [
                (segment["p_paddr"], segment["p_filesz"])
                for segment in elf.iter_segments("PT_LOAD")
                if segment["p_filesz"]
            ]
            self._read_symbols(elf.get_section_by_name(".symtab"))
            self._read_relocations(elf)

    def _read_symbols(self, table):
        if table is None:
            raise Unreadable("the image has no symbols")
        self.symbols, functions, kinds, mangled = {}, {}, {}, {}
        for symbol in table.iter_symbols():
            address = symbol["st_value"]
            if symbol.name.startswith(("$t", "$d")):
                kinds[address] = symbol.name[1]
            elif symbol["st_info"]["type"] == "STT_FUNC" and symbol["st_shndx"] != "SHN_UNDEF":
                # Of several names for a function, prefer one with its size.
                known = mangled.get(address & ~1)
                if known is None or not known[1]:
                    mangled[address & ~1] = symbol.name, symbol["st_size"]
            if symbol.name and symbol["st_info"]["bind"] == "STB_GLOBAL":
                self.symbols[symbol.name] = address
        self._begins = sorted(mangled)
        names = demangled([mangled[begin][0] for begin in self._begins])
        for index, (begin, name) in enumerate(zip(self._begins, names)):
            # An assembly function may not state its size: it ends where the next one begins, or with its section.
            ends = [*self._begins[index + 1 : index + 2], self.section_at(begin).end]
            functions[begin] = Function(name, begin, mangled[begin][1] or min(ends) - begin)
        self.functions = functions
        self._kinds = sorted(kinds.items())
        self._kind_begins = [begin for begin, _ in self._kinds]

    def _read_relocations(self, elf):
        """Finds the addresses of all words and instructions that hold an address."""
        self.addresses = set()
        found = False
        for section in elf.iter_sections():
            if section["sh_type"] in ("SHT_REL", "SHT_RELA"):
                found = True
                target = elf.get_section(section["sh_info"])
                if target["sh_flags"] & SHF_ALLOC:
                    offsets = (each["r_offset"] for each in section.iter_relocations())
                    self.addresses.update(offsets)
        if not found:
            raise Unreadable("the image has no relocations: link it with --emit-relocs")

    def section_at(self, address: int) -> Section | None:
        """Returns the section that contains an address."""
        return next((s for s in self.sections if s.begin <= address < s.end), None)

    def function_at(self, address: int) -> Function | None:
        """Returns the function that contains an address."""
        index = bisect.bisect_right(self._begins, address & ~1) - 1
        function = self.functions[self._begins[index]] if index >= 0 else None
        return function if function and address & ~1 < function.end else None

    def read(self, address: int, size: int) -> bytes:
        """Returns bytes of the image."""
        section = self.section_at(address)
        if section is None or section.bits is None:
            raise Unreadable(f"nothing is stored at {address:#x}")
        return section.bits[address - section.begin :][:size]

    def word(self, address: int) -> int:
        """Returns a word of the image."""
        return int.from_bytes(self.read(address, 4), "little")

    def code_ranges(self, function: Function):
        """Yields start and end of each part of a function that is instructions rather than data."""
        index = max(bisect.bisect_right(self._kind_begins, function.begin) - 1, 0)
        for position in range(index, len(self._kinds)):
            begin, kind = self._kinds[position]
            if begin >= function.end:
                break
            last = position + 1 == len(self._kinds)
            end = function.end if last else min(self._kinds[position + 1][0], function.end)
            begin = max(begin, function.begin)
            if kind == "t" and begin < end:
                yield begin, end

    def data_addresses(self):
        """Yields pairs of a place and the address stored there, outside functions and the vector table."""
        for place in sorted(self.addresses):
            section = self.section_at(place)
            stored = section and section.bits is not None and section.name != ".vector_table"
            if stored and not self.function_at(place):
                yield place, self.word(place)
