"""The Python module against its guide, its help and its types."""

import inspect
import os
import pydoc
import re
import subprocess
import sys

import pytest

import siskin
from paths import ROOT, SCENARIOS
from readme import blocks

CRATE = ROOT / "emulator" / "python"
GUIDE = CRATE / "README.md"
EXAMPLES = sorted((CRATE / "examples").glob("*.py"))

# What an example is given, and what it prints.
GIVEN = {
    "scenario": [SCENARIOS / "half-throttle.toml"],
    "sweep": [SCENARIOS / "random-drives.toml", 2],
    "cluster": [SCENARIOS / "random-drives.toml", 2],
}
PRINTED = {
    "cluster": r"<Table of 2 runs, 0 failed> equal to this machine's, bit for bit: True",
    "environment": r"(?s)^calm: 37\d\d rpm .*a weak pack: 19\.\d\d V",
    "faults": r"(?s)ESC 1: -?\d+ rpm, \w+, armed: False.*mended: 31[45]\d 31[45]\d rpm",
    "mavlink": r"(?s)^component 14\d is there.*\[0, 0, 0, 0\].*telemetry: \d{4} 31[345]\d \d{4} \d{4} rpm",
    "params": r"(?s)full throttle: 5000 4000 rpm\nMOT_POLE_PAIRS = 7 is refused",
    "record": r"(?s)^48001 control periods with t_s, .*run: 0\.\d+ to 2\.000 s, at most 31\d\d rpm",
    "scenario": r"(R x (0\.8|1\.0|1\.2): \w+ at \d+\.\d rpm, trace [0-9a-f]{16}: held\n){15}",
    "simulator": r"\d\.\d\d m after 2\.4 s, \d\.\d\d m/s at (\d{4,5}), \1, \1, \1 rpm",
    "sweep": r"<Table of 2 runs, 0 failed> with 115 columns",
}


def python(*arguments: object, cwd=ROOT) -> str:
    """Runs Python to its end, without this folder's modules."""
    clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    command = [sys.executable, *map(str, arguments)]
    ended = subprocess.run(command, cwd=cwd, env=clean, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(example, tmp_path):
    if example.stem.startswith("test_"):
        assert "3 passed" in python("-m", "pytest", "-q", "-p", "no:cacheprovider", example)
    else:
        assert re.search(PRINTED[example.stem], python(example, *GIVEN.get(example.stem, []), cwd=tmp_path))


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """mypy's cache; a folder from which the installed package is found."""
    return tmp_path_factory.mktemp("mypy")


@pytest.mark.parametrize("what", [["-p", "siskin"], EXAMPLES], ids=["package", "examples"])
def test_types_are_strict(what, checked):
    options = ["--strict", "--config-file", CRATE / "pyproject.toml", "--cache-dir", checked]
    assert "Success: no issues found" in python("-m", "mypy", *options, *what, cwd=checked)


def test_the_stubs_are_of_what_is_compiled(tmp_path):
    config = ["--mypy-config-file", CRATE / "pyproject.toml"]
    assert "Success" in python("-m", "mypy.stubtest", "siskin._siskin", *config, cwd=tmp_path)


def test_every_example_is_in_the_guide():
    listed = set(re.findall(r"\(examples/(\w+)\.py\)", GUIDE.read_text()))
    assert listed == {path.stem for path in EXAMPLES}


@pytest.mark.parametrize("guide", [GUIDE, ROOT / "emulator" / "README.md"], ids=["own", "emulator"])
def test_the_first_script_of_a_guide_turns_four_escs(guide):
    script = next(block for block in blocks("py", guide) if "siskin.Emulator" in block)
    speeds = re.search(r"\[(\d+), (\d+), (\d+), (\d+)\]", python("-c", script))
    assert speeds and all(int(rpm) > 3000 for rpm in speeds.groups()), speeds


def test_help_has_all_that_a_user_needs():
    text = pydoc.render_doc(siskin, renderer=pydoc.plaintext)
    for name in set(siskin.__all__) - {"__version__"}:
        assert re.search(rf"\b{name}\b", text), name
    for word in ("emulator.throttle[:] = 0.5", "Dask", "bus_v", "siskin-emulator scenario"):
        assert word in text, word


def members(kind: type):
    public = [name for name in vars(kind) if not name.startswith("_")]
    return [(f"{kind.__name__}.{name}", inspect.getattr_static(kind, name)) for name in public]


def test_everything_public_is_documented():
    classes = [thing for name in siskin.__all__ if inspect.isclass(thing := getattr(siskin, name))]
    things = [(name, getattr(siskin, name)) for name in siskin.__all__ if callable(getattr(siskin, name))]
    things += [member for kind in classes for member in members(kind)]
    assert len(things) > 50
    assert [name for name, thing in things if not inspect.getdoc(thing)] == []
    # Arguments too, in Sphinx's form.
    for function in (siskin.scenario, siskin.sweep, siskin.Emulator.environment, siskin.Faults.inject, siskin.Emulator):
        names = [name for name in inspect.signature(function).parameters if name not in ("self", "esc", "more")]
        assert [name for name in names if f":param {name}:" not in inspect.getdoc(function)] == []
