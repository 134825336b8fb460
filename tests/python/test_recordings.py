"""Recordings: other programs can read them."""

import contextlib
import json
import os
import signal
import subprocess
import time

import pytest
from pymavlink import mavutil

import siskin_dialect as dialect
from emulator import Emulator, run, scenario
from paths import PROGRAM, SCENARIOS

# When an offline run begins in its log: 2020-01-01 00:00 UTC.
OFFLINE_START_S = 1_577_836_800.0


def messages(path) -> list:
    """Returns all messages of a log, each with its time as `_timestamp`."""
    log = mavutil.mavlink_connection(str(path), dialect="ardupilotmega")
    found = []
    while (message := log.recv_msg()) is not None:
        assert message.get_type() != "BAD_DATA", message
        found.append(message)
    return found


def test_a_log_of_a_scenario_is_read_and_equal_each_time(tmp_path):
    logs = [tmp_path / "first.tlog", tmp_path / "second.tlog"]
    for path in logs:
        scenario(SCENARIOS / "half-throttle.toml", "--record", path)
    assert logs[0].read_bytes() == logs[1].read_bytes()

    log = messages(logs[0])
    times_s = [message._timestamp - OFFLINE_START_S for message in log]
    assert times_s == sorted(times_s)
    assert 0.0 <= times_s[0] < 1.0 and 5.0 < times_s[-1] <= 6.0
    telemetry = [message for message in log if message.get_type() == "ESC_TELEMETRY_1_TO_4"]
    assert len(telemetry) == 60, "ten a second"
    held = [m.rpm[0] for m in telemetry if 2.5 < m._timestamp - OFFLINE_START_S < 3.5]
    assert held == [pytest.approx(3150, abs=10)] * len(held) and held
    assert any(message.get_type() == "HEARTBEAT" for message in log)


def test_a_log_of_a_live_run_has_both_directions_and_the_time_of_day(tmp_path):
    path = tmp_path / "live.tlog"
    before_s = time.time()
    emulator = Emulator("--record", path)
    with emulator.connect() as esc:
        esc.command(dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_ESC_INFO)
    emulator.process.send_signal(signal.SIGINT)
    assert emulator.process.wait(timeout=10.0) == 0, emulator.output()
    log = messages(path)
    assert all(before_s - 0.1 < message._timestamp < time.time() + 0.1 for message in log)
    kinds = {message.get_type(): message.get_srcComponent() for message in log}
    assert kinds["COMMAND_LONG"] != kinds["COMMAND_ACK"] == kinds["HEARTBEAT"]


def test_a_log_has_what_a_false_start_has_held_back(tmp_path):
    path = tmp_path / "held.tlog"
    emulator = Emulator("--record", path)
    with emulator.connect() as esc:
        mark = esc.mark()
        # A start byte in noise claims 255 bytes: the frame after it is found when nothing more has come.
        request = dialect.MAVLink_param_request_read_message(1, 1, b"MOT_STOP", -1)
        esc.write(b"\xfd\xff" + request.pack(esc.codec))
        answer = esc.wait("PARAM_VALUE", lambda m: m.param_id == "MOT_STOP", mark)
        assert answer is not None
    emulator.process.send_signal(signal.SIGINT)
    assert emulator.process.wait(timeout=10.0) == 0, emulator.output()
    asked = [message for message in messages(path) if message.get_type() == "PARAM_REQUEST_READ"]
    assert [message.param_id for message in asked] == ["MOT_STOP"]


@pytest.mark.parametrize("several", [False, True])
def test_an_interrupted_scenario_keeps_what_was_played_however_often_it_is_asked(tmp_path, several):
    file, path = tmp_path / "long.toml", tmp_path / "long.csv"
    file.write_text(
        """
        [bench]
        duration_s = 10000.0
        [[signal]]
        at_s = 0.0
        throttle = 0.0
        [[window]]
        name = "first"
        t0_s = 0.0
        t1_s = 0.01
        [[window]]
        name = "all"
        t0_s = 0.0
        t1_s = 10000.0
        [[expect]]
        window = "first"
        key = "rpm_mean"
        equals = 0.0
        [[expect]]
        window = "all"
        key = "rpm_mean"
        equals = 0.0
        """
    )
    how = ["--seeds", "1..50"] if several else ["--record", str(path)]
    command = [str(PROGRAM), "scenario", str(file), "--json", *how]
    played = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if several:
        time.sleep(1.0)
    else:
        deadline = time.monotonic() + 30.0
        while not path.exists() or path.stat().st_size < 1e5:
            assert time.monotonic() < deadline
            time.sleep(0.05)
    played.send_signal(signal.SIGINT)
    played.send_signal(signal.SIGTERM)
    told, complaint = played.communicate(timeout=30.0)
    assert played.returncode == 130, complaint
    summary = json.loads(told)
    if several:
        assert (summary["runs"], summary["left_out"]) == (0, 50)
        return
    assert summary["interrupted"] is True and 0.0 < summary["sim_s"] < 10000.0
    assert [expected["held"] for expected in summary["expectations"]] == [True, None]
    lines = path.read_text().splitlines()
    assert len(lines) == summary["steps"] + 1
    assert {line.count(",") for line in lines} == {lines[0].count(",")}


@pytest.mark.parametrize("interrupted", [True, False])
def test_output_that_nobody_takes_is_kept_until_an_interrupt_comes(interrupted):
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(4096))
    os.set_blocking(writer, True)
    command = [str(PROGRAM), "scenario", str(SCENARIOS / "opening.toml"), "--json"]
    with (
        subprocess.Popen(command, stdout=writer, stderr=subprocess.PIPE) as played,
        open(reader, "rb") as output,
    ):
        os.close(writer)
        try:
            with pytest.raises(subprocess.TimeoutExpired):
                played.wait(timeout=3.0)
            if interrupted:
                # One that comes too soon ends the playing, not the writing.
                deadline = time.monotonic() + 20.0
                while played.poll() is None:
                    assert time.monotonic() < deadline
                    played.send_signal(signal.SIGINT)
                    time.sleep(0.5)
                assert played.returncode == 130
            else:
                told = output.read().lstrip(b"\0")
                assert json.loads(told)["sim_s"] == pytest.approx(0.4)
                assert played.wait(timeout=5.0) == 0
        finally:
            played.kill()


def test_a_dump_of_a_scenario_has_its_wires(tmp_path):
    path = tmp_path / "wires.vcd"
    scenario(SCENARIOS / "opening.toml", "--record", path)
    header, changes = path.read_text().split("$enddefinitions $end\n")
    assert "$timescale 1 ns $end" in header
    wires = {}
    for line in header.splitlines():
        if line.startswith("$var"):
            _, _, _, code, name, _ = line.split()
            wires[code] = name
    times_ns = [int(line[1:]) for line in changes.splitlines() if line.startswith("#")]
    assert times_ns[0] == 0 and times_ns == sorted(set(times_ns))
    assert times_ns[-1] == pytest.approx(0.4e9, abs=1e3)
    count = {name: 0 for name in wires.values()}
    for line in changes.splitlines():
        if line[0] in "01":
            count[wires[line[1:]]] += 1
    # A DShot frame has 16 bits, and there is one per millisecond.
    assert count["signal"] == pytest.approx(400 * 32, rel=0.02)
    # The throttle opens at 0.31 s; parking takes both gates of each leg through 24 periods per ms.
    assert all(count[f"{leg}_{side}"] > 1000 for leg in "abc" for side in ("high", "low"))


def test_a_build_without_parquet_says_so(tmp_path):
    path = tmp_path / "run.parquet"
    file = SCENARIOS / "half-throttle.toml"
    for arguments in [("scenario", file, "--record", path), ("plot", path, "-o", "x.svg")]:
        ended = run(*arguments)
        assert ended.returncode == 2
        assert str(path) in ended.stderr and "--features parquet" in ended.stderr
        assert len(ended.stderr.splitlines()) == 1
    assert not path.exists()
