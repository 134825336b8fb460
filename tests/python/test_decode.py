"""`siskin decode` on recordings of the emulator's wire."""

import json
import subprocess

import pytest

from emulator import scenario
from paths import SCENARIOS, TOOL


def test_it_shows_what_a_scenario_sent(tmp_path):
    path = tmp_path / "wires.vcd"
    scenario(SCENARIOS / "opening.toml", "--record", path)
    command = [str(TOOL), "decode", str(path), "--channel", "signal", "--json"]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    *rows, last = map(json.loads, ended.stdout.splitlines())
    summary = last["summary"]
    # The first frame begins with the recording, which lacks its first edge.
    assert (summary["signal"], summary["bad"]) == ("DShot600", 1)
    assert rows.pop(0)["error"] == "31 edges, no frame"
    # A frame per millisecond, and the throttle opens at 0.31 s.
    assert summary["good"] == pytest.approx(400, abs=2)
    assert summary["rate_hz"]["mean"] == pytest.approx(1000, rel=0.01)
    assert [row["throttle"] for row in rows] == [0, pytest.approx(0.5, abs=0.001)]
    assert rows[1]["time_s"] == pytest.approx(0.31, abs=0.002)
