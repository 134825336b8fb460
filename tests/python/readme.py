"""The commands that the READMEs tell a person to type."""

import re
import shlex
from pathlib import Path

from paths import ROOT

FRONT = ROOT / "README.md"
READMES = [FRONT, *(ROOT / crate / "README.md" for crate in ("emulator", "firmware", "shared", "tools"))]
READMES.append(ROOT / "emulator" / "python" / "README.md")
READMES += [ROOT / "tests" / folder / "README.md" for folder in ("flight", "virtual-board")]


def blocks(language: str, *readmes: Path) -> list[str]:
    """Returns the code blocks in a language, from some READMEs or from all."""
    # Those in a list are indented below its text.
    pattern = rf"^ *```{language}\n(.*?)^ *```"
    texts = (readme.read_text() for readme in readmes or READMES)
    return [block for text in texts for block in re.findall(pattern, text, re.MULTILINE | re.DOTALL)]


def _split(block: str) -> list[list[str]]:
    lines = block.replace("\\\n", " ").splitlines()
    return [words for line in lines if (words := shlex.split(line, comments=True))]


def commands(*words: str, of: Path | None = None) -> list[list[str]]:
    """Returns the words of each shell command that contains all of `words`, once each, in order, with aliases
    expanded; from one README, or from all."""
    found = []
    for readme in [of] if of else READMES:
        aliases: dict[str, list[str]] = {}
        for command in (command for block in blocks("sh", readme) for command in _split(block)):
            if command[0] == "alias":
                name, _, meaning = command[1].partition("=")
                aliases[name] = shlex.split(meaning)
                continue
            command = aliases.get(command[0], command[:1]) + command[1:]
            if set(words) <= set(command) and command not in found:
                found.append(command)
    return found
