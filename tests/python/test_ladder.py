"""Modules use those below them in their folder, never those above, and no two use each other.

A folder's modules are its files and folders, without tests. What a file names by `use`, `crate::`, `super::` or the
name of a child of its own is an edge between the two modules where their paths part. The file with a folder's name is
itself a module of that folder: it may re-export its children, but if it uses one, that child may not use what the file
defines.
"""

import functools
import graphlib
import json
import re
import subprocess
from collections import defaultdict
from pathlib import Path

import pytest

from paths import ROOT

CRATES = ["shared/units", "shared/params", "shared/throttle", "shared", "firmware", "emulator", "emulator/scope"]
OWN = "(itself)"

COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.S)
STRING = re.compile(r'"(?:\\.|[^"\\])*"', re.S)
USE = re.compile(r"^[ \t]*(pub(?:\([^)]*\))?\s+)?use\s+([^;]+);", re.M)
CHILD = re.compile(r"(#\[cfg\(test\)\]\s*)?^[ \t]*(?:pub(?:\([^)]*\))?\s+)?mod\s+(\w+)\s*;", re.M)
INLINE_TESTS = re.compile(r"#\[cfg\((?:all\()?test\b[^\]]*\]\s*(?:#\[[^\]]*\]\s*)*mod\s+\w+\s*\{.*", re.S)
INLINE = re.compile(r"\bmod\s+\w+\s*\{")
PATH = re.compile(r"(?<![\w:])((?:crate|self|super)(?:::\w+)+)")


def expanded(tree: str) -> list[tuple[list[str], str]]:
    """Returns a `use` tree's paths with the name that each brings in."""
    tree = tree.strip()
    if "{" in tree:
        head, _, rest = tree.partition("{")
        parts, depth = [""], 0
        for sign in rest[: rest.rindex("}")]:
            depth += {"{": 1, "}": -1}.get(sign, 0)
            if sign == "," and depth == 0:
                parts.append("")
            else:
                parts[-1] += sign
        return [path for part in parts if part.strip() for path in expanded(head.strip() + part.strip())]
    path, _, name = (part.strip() for part in tree.partition(" as "))
    steps = path.split("::")
    if steps[-1] == "self":
        steps.pop()
    return [(steps, name or steps[-1])]


def closing(code: str, start: int) -> int:
    """Returns where the brace open at the start is closed."""
    depth = 1
    for at in range(start, len(code)):
        depth += {"{": 1, "}": -1}.get(code[at], 0)
        if depth == 0:
            return at
    return len(code)


class Crate:
    """A crate's modules, and what each of its files names."""

    def __init__(self, name: str):
        self.code, self.children = {}, {}
        self.read((), ROOT / name / "src" / "lib.rs", ROOT / name / "src")
        self.uses = {module: list(self.used(module)) for module in self.code}
        self.names = {
            module: {name: path for _, path, name in uses} for module, uses in self.uses.items()
        }

    def read(self, module, file, folder):
        """Reads a file, and its children in the folder."""
        code = STRING.sub('""', COMMENT.sub("", file.read_text()))
        code = re.sub(r"pub\(in [^)]*\)", "pub", code)
        code = INLINE_TESTS.sub("", code)
        for inline in INLINE.finditer(code):
            # For a module within a file, `super` is the file.
            body = code[inline.end() : closing(code, inline.end())]
            code = code.replace(body, body.replace("super::", " self::"))
        self.code[module] = code
        self.children[module] = [child for test, child in CHILD.findall(code) if not test]
        for child in self.children[module]:
            below = folder / child
            files = [path for path in (folder / f"{child}.rs", below / "mod.rs") if path.exists()]
            for path in files:
                self.read((*module, child), path, below)

    def absolute(self, module, steps):
        """Returns a path from the crate's root; None if it leaves the crate."""
        first, *rest = steps
        if first == "crate":
            return tuple(rest)
        if first in ("self", "super"):
            while first == "super":
                module, first, rest = module[:-1], (rest or [""])[0], rest[1:] if rest[:1] == ["super"] else rest
            return (*module, *rest)
        return (*module, *steps) if first in self.children[module] else None

    def used(self, module):
        """Yields whether it is a re-export, the path, and its name here."""
        code = self.code[module]
        for visible, tree in USE.findall(code):
            for steps, name in expanded(tree):
                path = self.absolute(module, steps)
                if path is not None:
                    yield bool(visible), path, name
        body = USE.sub("", code)
        for path in PATH.findall(body):
            yield False, self.absolute(module, path.split("::")), None
        for child in self.children[module]:
            for item in re.findall(rf"(?<![\w:]){child}::(\w+)", body):
                yield False, (*module, child, item), None

    @functools.cache
    def defined(self, path, followed=10):
        """Returns where the item that a path names is defined, following re-exports."""
        for length in range(len(path)):
            module, name = path[:length], path[length]
            if followed and module in self.code and (*module, name) not in self.code and name in self.names[module]:
                target = self.names[module][name]
                if target[: length + 1] != path[: length + 1]:
                    return self.defined((*target, *path[length + 1 :]), followed - 1)
        return path

    def edges(self):
        """Returns, for each folder, which modules each module uses."""
        folders = {module: defaultdict(set) for module, below in self.children.items() if below}
        for module, uses in self.uses.items():
            body = USE.sub("", self.code[module])
            for visible, path, name in uses:
                if visible and not re.search(rf"\b{re.escape(name)}\b", body):
                    continue
                path = self.defined(path)
                part = next((k for k, (a, b) in enumerate(zip(module, path)) if a != b), min(len(module), len(path)))
                folder = module[:part]
                user = module[part] if part < len(module) else OWN
                used = path[part] if part < len(path) and path[: part + 1] in self.code else OWN
                if folder in folders and user != used:
                    folders[folder][user].add(used)
        return folders


def circle(uses):
    """Returns the modules of a cycle, each used by the one after it; none if there is an order."""
    try:
        graphlib.TopologicalSorter(uses).prepare()
    except graphlib.CycleError as error:
        return error.args[1]
    return []


@pytest.mark.parametrize("name", CRATES)
def test_modules_use_only_those_below(name):
    circles = []
    for folder, uses in sorted(Crate(name).edges().items()):
        place, found = "::".join(folder), circle(uses)
        if found:
            print(f"{name} {place}: circle", " → ".join(reversed(found)))
            circles.append(place)
        else:
            order = graphlib.TopologicalSorter(uses).static_order()
            print(f"{name} {place}:", " ← ".join(order))
    assert circles == [], "a circle among a folder's modules"


def test_the_crate_s_modules_stand_as_it_says():
    stated = (ROOT / "shared" / "src" / "lib.rs").read_text()
    stated = re.search(r"Dependencies run one way: (.*?)\.\s", stated.replace("\n//!", ""), re.S).group(1)
    levels = [re.findall(r"`(\w+)`", level) for level in stated.split("←")]
    height = {module: level for level, modules in enumerate(levels) for module in modules}
    crate = Crate("shared")
    assert sorted(height) == sorted(crate.children[()])
    uses = crate.edges()[()]
    upward = [
        f"{user} uses {used}"
        for user in uses
        for used in uses[user] - {OWN}
        if height[user] <= height[used]
    ]
    assert upward == []


def crates_used():
    """Returns the folder of each crate of the workspace, and the crates that it uses, itself among them, also for its
    build and its tests."""
    command = ["cargo", "metadata", "--no-deps", "--offline", "--format-version", "1"]
    packages = json.loads(subprocess.check_output(command, cwd=ROOT))["packages"]
    folders = {package["name"]: Path(package["manifest_path"]).parent.relative_to(ROOT) for package in packages}
    direct = {package["name"]: {need["name"] for need in package["dependencies"]} & folders.keys() for package in packages}
    used = {}
    for name in direct:
        used[name], new = set(), {name}
        while new:
            used[name] |= new
            new = set().union(*(direct[crate] for crate in new)) - used[name]
    return folders, used


def test_the_shared_crates_use_nothing_above_them():
    folders, used = crates_used()
    shared = [name for name, folder in folders.items() if folder.is_relative_to("shared")]
    assert {"siskin-control", "siskin-params", "siskin-throttle", "siskin-units"} <= set(shared)
    for name in shared:
        assert used[name] <= set(shared), name
    # Another throttle wire builds no parameter anew.
    assert "siskin-throttle" not in used["siskin-params"]
    assert used["siskin-units"] == {"siskin-units"}
