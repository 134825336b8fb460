"""What README.md tells a person to type."""

import re
import shlex

from paths import ROOT


def blocks(language: str) -> list[str]:
    """Its blocks of code in a language."""
    readme = (ROOT / "README.md").read_text()
    # Those of a list stand under its text.
    pattern = rf"^ *```{language}\n(.*?)^ *```"
    return re.findall(pattern, readme, re.MULTILINE | re.DOTALL)


def commands(*words: str) -> list[list[str]]:
    """The words of each shell command in it that has all of `words`."""
    lines = [line for block in blocks("sh") for line in block.replace("\\\n", " ").splitlines()]
    split = [shlex.split(line, comments=True) for line in lines]
    return [command for command in split if set(words) <= set(command)]
