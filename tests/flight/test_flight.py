"""Betaflight flies on the emulator's ESCs: within bounds, and the same twice."""

import contextlib
import subprocess
import sys
import xml.etree.ElementTree as xml

import pytest

import build
from paths import TARGET

PICTURE = TARGET / "debug" / "examples" / "flight-picture"


@pytest.fixture(scope="module", autouse=True)
def built():
    build.build()


@pytest.mark.parametrize(("plan", "mode"), [("tour", 0), ("tour", 2), ("punch", 2)])
def test_a_flight_keeps_its_bounds_and_is_the_same_twice(tmp_path, plan, mode):
    records = [tmp_path / "first.csv", tmp_path / "second.csv"]
    command = [sys.executable, build.FLIGHT / "fly.py", "--plan", plan, "--mode", str(mode), "--record"]
    with contextlib.ExitStack() as flying:
        # Side by side, at whatever pace each of them gets.
        flights = [
            flying.enter_context(
                subprocess.Popen([*command, record], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            )
            for record in records
        ]
        for flight in flights:
            flying.callback(flight.terminate)
        printed = [flight.communicate(timeout=300)[0] for flight in flights]
    print(printed[0])
    assert [flight.returncode for flight in flights] == [0, 0], printed
    assert printed[0] == printed[1]
    assert "hash" in printed[0]
    assert records[0].read_bytes() == records[1].read_bytes()
    assert PICTURE.exists(), "it is built by cargo build -p siskin-tests --example flight-picture"
    subprocess.run([PICTURE, records[0], tmp_path], check=True, timeout=60)
    assert xml.parse(tmp_path / "first.svg").getroot().tag.endswith("svg")
