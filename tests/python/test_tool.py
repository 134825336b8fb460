"""The `siskin` tool against the emulator."""

import json
import subprocess

import pytest

from paths import TOOL


@pytest.fixture
def siskin(start):
    """Runs the tool against a fresh emulator."""
    emulator = start()

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
