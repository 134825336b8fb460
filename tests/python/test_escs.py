"""Several ESCs in one process."""

import json
import subprocess

import pytest

from dshot import HALF
from emulator import run, simulate


@pytest.mark.parametrize("bench", [(), ("--bench", "quad-5-inch", "--bus", "16")])
def test_each_is_what_it_would_be_alone(bench):
    alone = simulate("--duration", 1, *bench)
    four = simulate("--duration", 1, "--escs", 4, *bench)
    assert [esc["trace_hash"] for esc in four["escs"]] == [alone["trace_hash"]] * 4
    assert four["steps"] == 4 * alone["steps"] and four["faults"] == []
    again = simulate("--duration", 1, "--escs", 4, *bench)
    assert again["trace_hash"] == four["trace_hash"]
    assert "escs" not in alone


def test_they_are_numbered_components_of_one_system(start, tmp_path):
    emulator = start("--escs", 6, storage=tmp_path / "flash")
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"flash.{esc}" for esc in range(6)]
    with emulator.connect() as esc:
        for component in range(140, 146):
            beat = esc.wait("HEARTBEAT", lambda m: m.get_srcComponent() == component)
            assert beat is not None and beat.get_srcSystem() == 1, component
        tells = lambda kind: {(m.get_srcComponent(), m.index) for m in esc.since(0, kind)}
        esc.wait("ESC_INFO", lambda m: m.get_srcComponent() == 144)
        assert tells("ESC_STATUS") == tells("ESC_INFO") == {(140, 0), (144, 4)}
        info = {m.get_srcComponent(): (m.count, m.info) for m in esc.since(0, "ESC_INFO")}
        assert info == {140: (6, 0b1111), 144: (6, 0b110000)}
        # An ESC whose telemetry another one sends has no such message.
        esc.component = 142
        assert esc.command(512, 291) == 2
        assert esc.read_param("MAV_COMP_ID").param_value == 142
        assert esc.set_param("TEL_RATE_HZ", 20) == 20
        esc.component = 143
        assert esc.read_param("TEL_RATE_HZ").param_value == 10


def test_each_has_its_wire(start):
    emulator = start("--escs", 2, "--param", "INP_LOSS_MS=500")
    second = type(emulator).throttle(emulator)
    second._port = emulator.signal_port + 1
    with emulator.connect(component=140) as esc, second:
        esc.next("HEARTBEAT", lambda m: m.get_srcComponent() == 141 and m.base_mode & 128)
        second.value = HALF
        status = esc.next("ESC_STATUS", lambda m: m.rpm[1] > 3000)
        assert status.rpm[0] == 0


def test_the_first_line_of_json_has_every_port():
    options = ("--json", "--duration", 0.01, "--storage", "none", "--escs", 3)
    ended = run("--mavlink", "tcpin:127.0.0.1:0", "--signal", "udp:127.0.0.1:0", *options)
    ready, summary = map(json.loads, ended.stdout.splitlines())
    ports = ready["ready"]
    assert ports["mavlink"][0].startswith("tcpin:127.0.0.1:") and ports["signal"] == ports["escs"][0]["signal"]
    assert len({esc["signal"] for esc in ports["escs"]}) == 3
    assert len(summary["escs"]) == 3 and summary["escs"][0]["windows"][0]["name"] == "all"


def test_recordings_have_the_number_of_their_esc(tmp_path):
    simulate("--duration", 0.01, "--escs", 2, "--record", tmp_path / "run.csv")
    rows = {path.name: len(path.read_text().splitlines()) for path in tmp_path.iterdir()}
    assert rows == {"run.0.csv": 241, "run.1.csv": 241}


@pytest.mark.parametrize(
    "options, words",
    [
        (("--escs", 9), "1..=8"),
        (("--escs", 0), "1..=8"),
        (("--escs", 8, "--param", "MAV_COMP_ID=245"), "MAV_COMP_ID"),
        (("--escs", 8, "--signal", "udp:127.0.0.1:65530"), "ESC 6 would be above port 65535"),
    ],
)
def test_what_cannot_be_is_said_in_a_line(options, words):
    if "--signal" not in options:
        options += ("--signal", "udp:127.0.0.1:0")
    ended = run("--mavlink", "none", "--storage", "none", *options)
    assert ended.returncode == 2 and words in ended.stderr and ended.stderr.count("\n") == 1, ended.stderr
