"""Scripts with nothing but the wheel of pymavlink, as a person pastes them."""

import os
import re
import subprocess
import sys

import pytest

from dshot import HALF
from emulator import PATIENT
from readme import blocks

SCRIPT = """
from pymavlink import mavutil

esc = mavutil.mavlink_connection("tcp:127.0.0.1:5760", dialect="ardupilotmega")
esc.wait_heartbeat(timeout=10)
for _ in range(5):
    t = esc.recv_match(type="ESC_TELEMETRY_1_TO_4", blocking=True, timeout=5)
    print(t.rpm[0], "rpm", t.voltage[0] / 100, "V")
"""


def run_script(text: str, emulator) -> str:
    """Runs a script with its ports exchanged for those of an emulator; gives what it prints."""
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
    assert any("ESC_TELEMETRY_1_TO_4" in script for script in blocks("python"))


@pytest.mark.parametrize("speed", [1, 0.6])
@pytest.mark.parametrize("index", range(len(blocks("python"))))
def test_a_script_of_the_readme_works_as_pasted(start, index, speed):
    # A busy machine is no lost signal. The virtual board runs below real time on a slow one.
    printed = run_script(blocks("python")[index], start(*PATIENT, speed=speed))
    rpm = [int(number) for number in re.findall(r"(-?\d+) rpm", printed)]
    assert abs(rpm[-1] - 3150) <= 32, f"half throttle: {rpm}"
