"""What the READMEs have a person type: every command and script, as pasted."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import test_scenarios
from dshot import HALF
from emulator import PATIENT, run
from paths import PROGRAM, ROOT, SCENARIOS, TOOL, VIRTUAL_BOARD
from readme import FRONT, READMES, blocks, commands

CONTRIBUTING = ROOT / "CONTRIBUTING.md"
EMULATOR = ROOT / "emulator" / "README.md"
LOCKSTEP = ROOT / "emulator" / "LOCKSTEP.md"

SCRIPT = """
from pymavlink import mavutil

esc = mavutil.mavlink_connection("tcp:127.0.0.1:5760", dialect="ardupilotmega")
esc.wait_heartbeat(timeout=10)
for _ in range(5):
    t = esc.recv_match(type="ESC_TELEMETRY_1_TO_4", blocking=True, timeout=5)
    print(t.rpm[0], "rpm", t.voltage[0] / 100, "V")
"""


def run_script(text: str, emulator) -> str:
    """Runs a script with its ports replaced by an emulator's; returns what it prints."""
    text = text.replace("5760", str(emulator.port)).replace("14600", str(emulator.signal_port))
    # The generated dialect must not be found.
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "MAVLINK"))}
    ended = subprocess.run(
        [sys.executable, "-c", text],
        env=clean,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_the_wheel_alone_reads_the_telemetry(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(3100, 3200)
        printed = run_script(SCRIPT, emulator)
    rpm = [float(line.split()[0]) for line in printed.splitlines()]
    volts = [float(line.split()[2]) for line in printed.splitlines()]
    assert len(rpm) == 5
    assert all(3100 <= value <= 3200 for value in rpm), rpm
    assert all(abs(value - 24.0) < 0.5 for value in volts), volts


def test_readme_has_a_script_that_reads_the_telemetry():
    assert any("ESC_TELEMETRY_1_TO_4" in script for script in blocks("python", FRONT))


@pytest.mark.parametrize("speed", [1, 0.6])
@pytest.mark.parametrize("index", range(len(blocks("python"))))
def test_a_script_of_a_readme_works_as_pasted(start, index, speed):
    # A busy machine is not a lost signal. The virtual board runs below real time on a slow one.
    printed = run_script(blocks("python")[index], start(*PATIENT, speed=speed))
    rpm = [int(number) for number in re.findall(r"(-?\d+) rpm", printed)]
    assert abs(rpm[-1] - 3150) <= 32, f"half throttle: {rpm}"


def recipe(word: str) -> str:
    """Returns the recipe in the emulator's README that contains this word."""
    return next(block for block in blocks("py", EMULATOR) if word in block)


def test_the_recipe_for_pytest_passes(tmp_path):
    (tmp_path / "test_esc.py").write_text(recipe("pytest").replace('"target/release/siskin-emulator"', repr(str(PROGRAM))))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_esc.py"]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0 and "1 passed" in ended.stdout, ended.stdout


def test_the_recipe_for_four_escs_turns_them(start):
    printed = run_script(recipe("range(4)"), start("--escs", 4, *PATIENT))
    *speeds, _ = printed.splitlines()[-1].split()
    assert len(speeds) == 4 and all(abs(int(rpm) - 3150) <= 32 for rpm in speeds), printed[-200:]


def test_the_recipe_for_lockstep_names_what_is_there():
    example = (ROOT / "emulator" / "lockstep" / "example.c").read_text()
    # test_lockstep.py builds and runs it.
    assert "cargo run --release -- --speed lockstep --escs 4 --bus 6s" in example
    assert "--speed lockstep --escs 4 --bus 6s" in EMULATOR.read_text()


def test_the_container_builds_what_the_workspace_has():
    text = (ROOT / "emulator" / "Containerfile").read_text()
    channel = re.search(r'channel = "(\d+\.\d+)', (ROOT / "rust-toolchain.toml").read_text()).group(1)
    assert f"rust:{channel}-slim" in text
    entry = json.loads(re.search(r"^ENTRYPOINT (\[.*\])$", text, re.MULTILINE).group(1))
    # Ports of the machine's choice, since others may be using these.
    options = [re.sub(r":(5760|14600)$", ":0", word) for word in entry[1:]]
    ended = run(*options, "--json", "--duration", 0.01)
    assert entry[0] == PROGRAM.name and ended.returncode == 0, ended.stderr


# The programs that `cargo run` starts, by their -p option.
PROGRAMS = {None: PROGRAM, "siskin": TOOL, "siskin-vboard": VIRTUAL_BOARD}

# A bench that suits a README's commands, if the default one does not.
BENCHES = {"firmware": ("--bench", "bare", "--bus", "12")}

PROBE_RS = """#!/bin/sh
echo "probe-rs $*" >>"$0.log"
"""


def program(command: list[str]) -> tuple[Path | None, list[str]]:
    """Returns the program that a command runs, and its arguments; no program if it is not `cargo run`."""
    if command[:3] != ["cargo", "run", "--release"]:
        return None, command
    options, _, arguments = " ".join(command[3:]).partition("--")
    package = options.split()[-1] if options.split() else None
    arguments = command[command.index("--") + 1 :] if "--" in command else []
    return PROGRAMS[package], arguments


def is_run_elsewhere(command: list[str]) -> bool:
    """Returns whether another test runs it as in the README."""
    path, words = program(command)
    if path is None:
        # This test is part of the first; tests/flight/test_flight.py and test_throttle_curve.py run the others.
        pictures = {"flight-picture", "throttle-curve"}
        return words == ["tests/run"] or "tests/flight/fly.py" in words or bool(pictures & set(words))
    if path == VIRTUAL_BOARD:
        # test_virtual_board.py
        return True
    if path == TOOL:
        # Until Ctrl-C: test_scope_link.py.
        return words == ["scope"]
    if not words:
        return False
    if words == ["bench"]:
        return "cargo run --release -- bench" in (ROOT / "tests" / "run").read_text()
    if words[:2] == ["scenario", "tests/scenarios/throttle-curve.toml"]:
        # test_throttle_curve.py
        return True
    if words[0] == "scenario" and "--record" not in words:
        scenario = ROOT / words[1]
        assert scenario.parent == SCENARIOS and scenario.exists(), words
        seeds = test_scenarios.SEEDS.get(scenario.stem)
        assert words[2:] == (["--seeds", seeds] if seeds else []), f"test_scenarios.py plays {seeds}"
        return True
    # test_reproduce.py, test_matrix.py
    return words[0] in ("reproduce", "plot", "matrix") or "target/first-spin.csv" in words


def first_has(readme: Path) -> list[list[str]]:
    """Returns the commands of a README that no earlier README has."""
    before = [command for other in READMES[: READMES.index(readme)] for command in commands(of=other)]
    return [command for command in commands(of=readme) if command not in before]


@pytest.mark.parametrize("readme", READMES, ids=lambda path: path.parent.name)
def test_every_command_of_a_readme_ends_well(start, tmp_path, readme):
    # They are typed one after another: some read what others have written.
    todo = [command for command in first_has(readme) if not is_run_elsewhere(command)]
    if not todo:
        return
    standing_in = tmp_path / "bin" / "probe-rs"
    standing_in.parent.mkdir()
    standing_in.write_text(PROBE_RS)
    standing_in.chmod(0o755)
    environment = {**os.environ, "PATH": f"{standing_in.parent}:{os.environ['PATH']}"}
    emulator = start(*BENCHES.get(readme.parent.name, ()), storage=tmp_path / "flash")
    for command in todo:
        path, words = program(command)
        if path is not None:
            words = [str(path), *(word.replace("target/", f"{tmp_path}/") for word in words)]
        if path == TOOL and "--connect" in words:
            # A board's serial line.
            del words[words.index("--connect") : words.index("--connect") + 2]
        if path == TOOL and not {"image", "flash", "decode", "budget", "tune"} & set(words):
            words[1:1] = ["--connect", f"tcp:127.0.0.1:{emulator.port}"]
        if "monitor" in words and "--count" not in words:
            # Until Ctrl-C.
            words += ["--count", "3"]
        if path == PROGRAM and "scenario" not in words:
            # Until Ctrl-C, at the usual addresses.
            words += ["--duration", "0.2", "--mavlink", "none", "--signal", "udp:127.0.0.1:0"]
            words += ["--storage", "none"]
        ended = subprocess.run(
            words,
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=600,
        )
        assert ended.returncode == 0, f"{' '.join(command)}\n{ended.stdout}{ended.stderr}"
    if any("flash" in command for command in todo):
        assert "probe-rs download" in standing_in.with_suffix(".log").read_text()


def test_every_toml_block_is_part_of_a_scenario_that_holds(tmp_path):
    whole, *parts = blocks("toml")
    for part in ["", *parts]:
        scenario = tmp_path / "readme.toml"
        scenario.write_text(f"{whole}\n{part}")
        ended = run("scenario", scenario)
        assert ended.returncode == 0, f"{part}\n{ended.stdout}{ended.stderr}"


def anchors(text: str) -> set[str]:
    """Returns the anchors of a file's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("file", [*READMES, CONTRIBUTING, LOCKSTEP, ROOT / "CHANGELOG.md"], ids=str)
def test_every_link_leads_somewhere(file):
    text = re.sub(r"^ *```.*?^ *```", "", file.read_text(), flags=re.MULTILINE | re.DOTALL)
    links = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r"^\[[^\]]+\]: (\S+)$", text, re.MULTILINE)
    assert links
    for link in links:
        if link.startswith("https://"):
            continue
        path, _, anchor = link.partition("#")
        there = file.parent / path if path else file
        assert there.exists(), link
        if anchor:
            assert anchor in anchors(there.read_text()), link


def test_the_files_that_contributors_are_led_to_are_there():
    named = re.findall(r"`([\w./-]+/[\w./-]*)`", CONTRIBUTING.read_text())
    assert len(named) > 20
    # NAME stands for a board or bench to come.
    absent = [name for name in named if "NAME" not in name and not (ROOT / name).exists()]
    assert absent == []


def test_every_parameter_that_is_named_exists():
    table = (ROOT / "shared" / "params" / "src" / "table.rs").read_text()
    known = set(re.findall(r'"([A-Z]{3}_[A-Z0-9_]+)"', table))
    assert len(known) > 50
    groups = "|".join({name[:4] for name in known})
    for file in [*READMES, CONTRIBUTING]:
        named = set(re.findall(rf"\b(?:{groups})[A-Z0-9_]+\b", file.read_text()))
        # MAVLink's own commands begin like its parameters.
        unknown = {name for name in named - known if not name.startswith("MAV_CMD_")}
        assert unknown == set(), file
