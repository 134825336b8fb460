"""`siskin faults` against the emulator: the record of a fault, across a restart, and as a picture."""

import json
import subprocess

import siskin_dialect as dialect

from dshot import HALF, STOP
from emulator import PATIENT, Emulator, run
from paths import TOOL

HALF_RPM = 3150
SAG_S = 6.0
POLE_PAIRS = 12


def faults(emulator: Emulator, *arguments: object) -> subprocess.CompletedProcess:
    command = [TOOL, "--connect", f"tcp:127.0.0.1:{emulator.port}", "faults", *arguments]
    return subprocess.run(
        [str(part) for part in command], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60
    )


def test_a_trip_at_speed_is_on_record_with_the_periods_before_it(start, tmp_path):
    # Once the motor turns, even on a busy machine, the supply falls below the 9 V of LIM_BUS_V_MIN.
    emulator = start(*PATIENT, "--fault", f'at_s = {SAG_S}, for_s = 1.0, kind = "bus_sag", value = 18.0')
    ended = faults(emulator, "--json")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert json.loads(ended.stdout) == {"items": [], "periods_of": None, "periods": []}
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(HALF_RPM - 50, HALF_RPM + 50)
        esc.next("STATUSTEXT", lambda m: m.text == "Fault: bus under-voltage")
        assert esc.next("HEARTBEAT").custom_mode == 1 << 2, "the fault's number"
        throttle.value = STOP
        esc.next("STATUSTEXT", lambda m: m.text == "Fault ended: bus under-voltage")
        assert esc.next("HEARTBEAT").custom_mode == 0
    record = tmp_path / "record.bin"
    ended = faults(emulator, "--json", "--save", record)
    assert ended.returncode == 1 and "one fault on record" in ended.stderr
    told = json.loads(ended.stdout)
    [fault] = told["items"]
    assert (fault["number"], fault["condition"], fault["name"]) == (1, 2, "bus under-voltage")
    assert (fault["phase"], fault["starts_ago"]) == ("run", 0)
    # What the ESC believes: with a supply suddenly too low for the speed, its estimate is off by then.
    assert abs(fault["rpm"] / HALF_RPM - 1.0) < 0.2
    assert abs(fault["bus_v"] - 6.0) < 0.1
    # When the chip has found it, by the emulator's clock.
    assert SAG_S < fault["time_s"] < SAG_S + 0.05
    periods = told["periods"]
    assert told["periods_of"] == 1 and len(periods) == 64
    assert periods[-1]["duties"] == [None] * 3
    step = periods[1]["time_s"] - periods[0]["time_s"]
    assert abs(step - 1 / 24_000) < 1e-8 and abs(periods[-1]["time_s"] + step) < 1e-8
    # The supply's filter takes some 10 periods to reach the limit.
    sound = periods[:48]
    assert all(abs(period["bus_v"] - 24.0) < 0.1 for period in sound)
    for before, period in zip(sound, sound[1:]):
        assert all(0.0 <= duty <= 1.0 for duty in period["duties"])
        # 0.02 A per count: three shunts, each read separately.
        assert abs(sum(period["currents_a"])) < 0.5
        turned = (period["angle_deg"] - before["angle_deg"]) % 360.0
        assert abs(turned - period["rpm"] / 60 * POLE_PAIRS * 360 / 24_000) < 0.5
        assert abs(period["rpm"] - HALF_RPM) < 50
    assert max(abs(period["currents_a"][0]) for period in periods) > 1.0

    picture = tmp_path / "record.svg"
    drawn = run("plot", record, "-o", picture)
    assert (drawn.returncode, drawn.stderr) == (0, "")
    assert "bus under-voltage" in picture.read_text()

    # It was read, but nothing has turned since; a restart keeps it.
    with emulator.connect() as esc:
        esc.wait_rpm(-100, 100)
        esc.wait_armed(False)
        assert esc.command(dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == dialect.MAV_RESULT_ACCEPTED
        esc.wait("STATUSTEXT", lambda m: m.text.startswith("Siskin ESC "))
    again = faults(emulator)
    assert again.returncode == 1
    [line, note] = again.stdout.splitlines()
    assert "bus under-voltage" in line and line.endswith("one start ago")
    assert "64 control periods before fault 1" in note


def test_a_file_that_is_no_record_is_no_picture(tmp_path):
    record = tmp_path / "record.bin"
    record.write_bytes(b"nothing of the kind")
    drawn = run("plot", record, "-o", tmp_path / "picture.svg")
    assert drawn.returncode == 2 and "not a fault record" in drawn.stderr
    assert len(drawn.stderr.splitlines()) == 1
