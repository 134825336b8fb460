"""`siskin check` against the emulator."""

import json
import subprocess

import pytest
import siskin_dialect as dialect

from emulator import Emulator
from paths import TOOL


def check(emulator: Emulator, *arguments: str) -> subprocess.CompletedProcess:
    command = [str(TOOL), "--connect", f"tcp:127.0.0.1:{emulator.port}", "check", *arguments]
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60
    )


def items(ended: subprocess.CompletedProcess) -> dict:
    return {item.pop("name"): item for item in json.loads(ended.stdout)["items"]}


def test_a_sound_esc_passes(start):
    emulator = start()
    ended = check(emulator, "--json")
    assert ended.returncode == 0, ended.stderr
    found = items(ended)
    phases = [
        f"{kind}_{phase}"
        for kind in ("zero", "noise", "rest", "high", "motor", "low", "off")
        for phase in "abc"
    ]
    assert list(found) == ["supply", "temperature", *phases]
    assert all(item["ok"] for item in found.values())
    supply = found["supply"]
    assert (supply["unit"], supply["low"], supply["high"]) == ("V", 9.0, 30.0)
    assert abs(supply["value"] - 24.0) < 0.1
    told = check(emulator)
    assert told.returncode == 0 and len(told.stdout.splitlines()) == len(found)
    assert "zero_b" in told.stdout and "FAILED" not in told.stdout


@pytest.mark.parametrize(
    ("fault", "item"),
    [
        ('kind = "mosfet_open", phase = 0, side = "low"', "low_a"),
        ('kind = "mosfet_open", phase = 1', "high_b"),
        ('kind = "mosfet_short", phase = 0, side = "high"', "rest_a"),
        ('kind = "mosfet_short", phase = 2, side = "low"', "off_c"),
        ('kind = "phase_open", phase = 1', "motor_b"),
        ('kind = "sensor_stuck", phase = 2, value = 1.0', "noise_c"),
        ('kind = "offset_drift", phase = 0, value = -5.0', "zero_a"),
    ],
)
def test_a_defect_is_named(start, fault, item):
    # The tune at the start would find some of them first.
    emulator = start("--fault", fault, "--param", "MOT_TONE_A=0")
    ended = check(emulator, "--json")
    assert ended.returncode == 1, ended.stderr
    found = items(ended)
    assert not found[item]["ok"]
    assert item in ended.stderr and len(ended.stderr.splitlines()) == 1


def test_a_fault_that_holds_refuses_it(start):
    emulator = start("--bus", "8")
    # The fault takes its filter's time; before that, the power-up test would find the supply low.
    with emulator.connect() as esc:
        esc.wait("HEARTBEAT", lambda beat: beat.system_status == dialect.MAV_STATE_CRITICAL)
    ended = check(emulator)
    assert ended.returncode == 1 and ended.stdout == ""
    assert "not now" in ended.stderr


def test_a_fault_that_is_none_is_refused():
    for fault in ("kind = 5", "kind = \"mosfet_open\"", "x", "kind = \"phase_open\", phase = 3"):
        from emulator import run

        ended = run("--fault", fault)
        assert ended.returncode == 2 and "--fault" in ended.stderr
        assert len(ended.stderr.splitlines()) == 1
