"""The `siskin` tool against the emulator."""

import json
import re
import subprocess
import time

import pytest

from emulator import OF_BENCH
from paths import TOOL


@pytest.fixture
def siskin(start):
    """Runs the tool against a fresh emulator."""
    return tool(start())


@pytest.fixture
def siskin_stored(start, tmp_path):
    """The same, with a file for its storage."""
    return tool(start(storage=tmp_path / "flash"))


def tool(emulator):
    """Runs the tool against an emulator."""

    def run(*arguments: object) -> subprocess.CompletedProcess:
        connect = ("--connect", f"tcp:127.0.0.1:{emulator.port}")
        return subprocess.run(
            [str(TOOL), *connect, *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=60,
        )

    return run


def test_it_lists_and_gets_parameters(siskin):
    listed = siskin("params", "list", "--json")
    assert listed.returncode == 0, listed.stderr
    values = json.loads(listed.stdout)
    assert len(values) > 30 and values["MOT_POLE_PAIRS"] == 12
    got = siskin("params", "get", "--json", "MOT_STOP", "INP_ARM_MS")
    assert json.loads(got.stdout) == {"MOT_STOP": 1, "INP_ARM_MS": 300}


def test_it_sets_parameters_and_tells_what_was_refused(siskin):
    changed = siskin("params", "set", "LIM_PHASE_A", 15, "MOT_STOP", 0)
    assert changed.returncode == 0, changed.stderr
    got = json.loads(siskin("params", "get", "--json", "LIM_PHASE_A", "MOT_STOP").stdout)
    assert got == {"LIM_PHASE_A": 15, "MOT_STOP": 0}
    refused = siskin("params", "set", "LIM_PHASE_A", -1)
    assert refused.returncode == 1 and "LIM_PHASE_A" in refused.stderr


def test_it_saves_to_a_file_and_loads_it_again(siskin, tmp_path):
    path = tmp_path / "esc.param"
    saved = siskin("params", "save", path)
    assert saved.returncode == 0, saved.stderr
    before = json.loads(siskin("params", "list", "--json").stdout)
    assert siskin("params", "set", "LIM_PHASE_A", 15, "CTL_RPM_MAX", 4000).returncode == 0
    loaded = siskin("params", "load", path)
    assert loaded.returncode == 0, loaded.stderr
    assert json.loads(siskin("params", "list", "--json").stdout) == before


def test_values_are_told_with_unit_range_and_meaning(siskin):
    listed = siskin("params", "list").stdout.splitlines()
    words = {line.split()[0]: line.split(maxsplit=1)[1] for line in listed}
    assert words["LIM_PHASE_A"] == "20 A" and words["MOT_STOP"] == "1 (brake)"
    described = siskin("params", "describe", "LIM_PHASE_A", "mot_stop")
    assert described.returncode == 0, described.stderr
    assert "20 A" in described.stdout and "0 (coast) or 1 (brake)" in described.stdout
    assert "At zero throttle and at loss of signal" in described.stdout
    refused = siskin("params", "set", "LIM_PHASE_A", -1)
    assert refused.returncode == 1
    low, high = re.search(r"give (\S+) to (\S+) A", refused.stderr).groups()
    assert f"{low} to {high} A" in described.stdout, "the same range"


def test_it_tells_what_is_not_the_factorys_and_gives_that_back(siskin, tmp_path):
    path = tmp_path / "esc.param"
    assert siskin("params", "reset", *OF_BENCH).returncode == 0
    assert siskin("params", "diff").stdout == "0 different\n"
    assert siskin("params", "save", path).returncode == 0
    assert siskin("params", "set", "LIM_PHASE_A", 15, "MOT_STOP", 0).returncode == 0
    differ = siskin("params", "diff").stdout.splitlines()
    assert [line.split(maxsplit=1) for line in differ] == [
        ["MOT_STOP", "0 (coast), from the factory 1 (brake)"],
        ["LIM_PHASE_A", "15 A, from the factory 20 A"],
        ["2", "different"],
    ]
    to_file = siskin("params", "diff", path).stdout
    assert f"15 A, in {path} 20 A" in to_file and to_file.endswith("2 different\n")
    reset = siskin("params", "reset", "MOT_STOP")
    assert reset.returncode == 0, reset.stderr
    assert json.loads(siskin("params", "get", "--json", "MOT_STOP").stdout) == {"MOT_STOP": 1}
    assert siskin("params", "diff").stdout.endswith("1 different\n")
    assert siskin("params", "reset").returncode == 2, "it is told which"
    assert siskin("params", "reset", "MOT_KV").returncode == 2, "it has no value of its own"


def test_all_parameters_can_be_reset(siskin_stored):
    assert siskin_stored("params", "set", "LIM_PHASE_A", 15, "--store").returncode == 0
    reset = siskin_stored("params", "reset", "--all")
    assert reset.returncode == 0, reset.stderr
    differ = siskin_stored("params", "diff").stdout.splitlines()
    assert [line.split()[0] for line in differ] == [*OF_BENCH, str(len(OF_BENCH))]


@pytest.mark.parametrize("command", ["image", "flash", "decode", "budget", "tune"])
def test_what_needs_no_esc_offers_no_way_to_one(command):
    def run(*arguments):
        return subprocess.run([str(TOOL), *arguments], capture_output=True, text=True, timeout=60)

    shown = run(command, "--help").stdout
    assert "Usage:" in shown and "--connect" not in shown and "--system" not in shown
    assert ("--component" in shown) == (command in ("budget", "tune"))
    connect = ("--connect", "tcp:127.0.0.1:1")
    for arguments in ((command, *connect), (*connect, command, "word", "--output", "nowhere")):
        if command != "image":
            arguments = [word for word in arguments if word not in ("--output", "nowhere")]
        refused = run(*arguments)
        assert refused.returncode == 2, refused.stderr
        assert f"'{command}' needs no ESC: leave out --connect" in refused.stderr
        assert len(refused.stderr.splitlines()) == 1
    assert "--connect" in run("params", "list", "--help").stdout


def test_the_hint_of_the_emulator_reaches_it(start):
    emulator = start()
    until = time.monotonic() + 20.0
    hints = []
    # They come after the ports, for which the start has waited.
    while len(hints) < 2 and time.monotonic() < until:
        time.sleep(0.02)
        lines = emulator.output().splitlines()
        hints = [line.split("--", maxsplit=2)[2] for line in lines if "-p siskin --" in line]
    assert len(hints) == 2, emulator.output()
    for hint in hints:
        command = f"--{hint}".replace("-- ", "", 1).split()
        more = ("--count", "1") if command[-1] == "monitor" else ()
        ended = subprocess.run([str(TOOL), *command, *more], capture_output=True, text=True, timeout=60)
        assert ended.returncode == 0, f"{command}: {ended.stderr}"


def test_it_monitors(siskin):
    monitored = siskin("monitor", "--json", "--count", 3)
    assert monitored.returncode == 0, monitored.stderr
    samples = [json.loads(line) for line in monitored.stdout.splitlines()]
    assert sum("rpm" in sample for sample in samples) == 3


def test_it_monitors_the_signals_that_were_chosen(siskin):
    assert siskin("params", "set", "TEL_SIGNALS", 4 + 128, "TEL_SIG_HZ", 20).returncode == 0
    monitored = siskin("monitor", "--json", "--count", 5)
    lines = [json.loads(line) for line in monitored.stdout.splitlines()]
    signals = [line for line in lines if "signal" in line]
    assert {line["signal"] for line in signals} == {"i_d", "bus_v"}
    volts = [line["value"] for line in signals if line["signal"] == "bus_v"]
    assert all(23 < value < 25 for value in volts) and len(volts) >= 5
    shown = siskin("monitor", "--count", 5)
    assert "bus_v" in shown.stdout and "rpm_ref" not in shown.stdout


def test_without_an_esc_it_says_so(siskin):
    ended = siskin("params", "list", "--connect", "tcp:127.0.0.1:1")
    assert ended.returncode == 2
    assert len(ended.stderr.splitlines()) == 1
