"""Names of functions as the source has them, the same from either scheme by which compilers spell
symbols: legacy and v0."""

import re
import subprocess


def demangled(symbols: list[str]) -> list[str]:
    """The names of symbols. The linker's jumps to functions far away have the function's name."""
    text = subprocess.run(
        ["c++filt", "-s", "rust"],
        input="\n".join(re.sub(r"\.llvm\.\d+$|^__Thumbv7\w+Thunk_", "", symbol) for symbol in symbols),
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return [plain(name) for name in text.split("\n")]


def plain(name: str) -> str:
    """A name without hashes and without what is put in for generic parameters, which legacy leaves out:
    `<a::B<c::D>>::e::<f::G>::{closure#0}` is `a::B::e::{closure}`, and `<a::B<c::D> as h::I<j>>::k` is
    `<a::B as h::I>::k`."""
    name = re.sub(r"::h[0-9a-f]{16}$", "", name)
    # Of crates; nothing else has a bracket right behind a word.
    name = re.sub(r"(?<=\w)\[[0-9a-f]+\]", "", name)
    name = re.sub(r"::\{shim:vtable#0\}|\{\{vtable\.shim\}\}", "{vtable.shim}", name)
    name = re.sub(r"\{\{(\w+)\}\}|\{(\w+)(?:#\d+|:[^{}]*#\d+)\}", lambda m: f"{{{m[1] or m[2]}}}", name)
    return _without_arguments(name)


def _without_arguments(name: str) -> str:
    found, at = "", 0
    while at < len(name):
        if name[at] != "<":
            found, at = found + name[at], at + 1
            continue
        end = _closing(name, at)
        if re.search(r"[\w}]$|::$", found):
            found = found.removesuffix("::")
        else:
            inner = _without_arguments(name[at + 1 : end])
            found += f"<{inner}>" if " as " in inner else inner
        at = end + 1
    return found


def _closing(name: str, begin: int) -> int:
    """Where the bracket that opens there is closed; the arrow of a function's type closes none."""
    depth = 0
    for at in range(begin, len(name)):
        if name[at] == "<":
            depth += 1
        elif name[at] == ">" and name[at - 1] != "-":
            depth -= 1
            if depth == 0:
                return at
    return len(name)
