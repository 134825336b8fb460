"""Names of functions as in the source, the same from both schemes by which compilers mangle symbols: legacy and v0."""

import re
import subprocess


def demangled(symbols: list[str]) -> list[str]:
    """Returns the symbols' names. The linker's far jumps have their function's name."""
    text = subprocess.run(
        ["c++filt", "-s", "rust"],
        input="\n".join(re.sub(r"\.llvm\.\d+$|^__Thumbv7\w+Thunk_", "", symbol) for symbol in symbols),
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return [plain(name) for name in text.split("\n")]


def plain(name: str) -> str:
    """Returns a name without hashes and without generic arguments, which legacy leaves out:
    `<a::B<c::D>>::e::<f::G>::{closure#0}` is `a::B::e::{closure}`, and `<a::B<c::D> as h::I<j>>::k` is
    `<a::B as h::I>::k`."""
    name = re.sub(r"::h[0-9a-f]{16}$", "", name)
    # Crate hashes; nothing else has a bracket right after a word.
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
    """Returns where the bracket opened there is closed; the arrow of a function type closes none."""
    depth = 0
    for at in range(begin, len(name)):
        if name[at] == "<":
            depth += 1
        elif name[at] == ">" and name[at - 1] != "-":
            depth -= 1
            if depth == 0:
                return at
    return len(name)
