"""What survives a kill at any moment: all of what was last stored, or all of what was stored before."""

import os
import random
import time
from pathlib import Path

import pytest
from test_ftp import Files

import siskin_dialect as dialect
from emulator import run

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
FAILED = dialect.MAV_RESULT_FAILED
STORAGE = dialect.MAV_CMD_PREFLIGHT_STORAGE
GET_INTERVAL = dialect.MAV_CMD_GET_MESSAGE_INTERVAL
ESC_STATUS = 291
HALF = 1048

QUIET_S = 2.5
"""Longer than the second without changes after which settings are stored, on a busy machine."""

TUNE_S = 0.5


@pytest.fixture
def stored(start, tmp_path):
    """Starts emulators with the same storage, one after another."""
    return lambda: start(storage=tmp_path / "flash.bin")


def test_what_is_set_is_stored_by_itself(stored):
    emulator = stored()
    with emulator.connect() as esc:
        esc.set_param("LIM_PHASE_A", 12.5)
        esc.stream(ESC_STATUS, 40_000)
        time.sleep(QUIET_S)
        told = [m.text for m in esc.since(0, "STATUSTEXT")]
        assert not [text for text in told if "stor" in text], "nobody has asked"
    emulator.kill()
    with stored().connect() as esc:
        assert esc.read_param("LIM_PHASE_A").param_value == 12.5
        mark = esc.mark()
        assert esc.command(GET_INTERVAL, ESC_STATUS) == ACCEPTED
        assert esc.wait("MESSAGE_INTERVAL", since=mark).interval_us == 40_000
        assert esc.command(STORAGE, 2) == ACCEPTED
        assert esc.read_param("LIM_PHASE_A").param_value == 20.0
        mark = esc.mark()
        assert esc.command(GET_INTERVAL, ESC_STATUS) == ACCEPTED
        assert esc.wait("MESSAGE_INTERVAL", since=mark).interval_us == 100_000


def test_a_kill_while_values_are_stored_leaves_the_old_or_the_new_ones(stored):
    chance = random.Random(1)
    old = new = (20.0, 6000.0)
    found_new = 0
    for _ in range(20):
        emulator = stored()
        with emulator.connect() as esc:
            # Nothing is stored while the start-up tune plays.
            time.sleep(TUNE_S)
            found = tuple(
                esc.read_param(name).param_value for name in ("LIM_PHASE_A", "CTL_RPM_MAX")
            )
            assert found in (old, new)
            found_new += found == new != old
            texts = [m.text for m in esc.since(0, "STATUSTEXT")]
            assert not [text for text in texts if "corrupt" in text or "defaults" in text], texts
            old, new = found, (chance.randint(10, 29) + 0.5, float(chance.randint(4000, 5999)))
            for name, value in zip(("LIM_PHASE_A", "CTL_RPM_MAX"), new):
                esc.set_param(name, value)
            esc.codec.command_long_send(1, 1, STORAGE, 0, 1, 0, 0, 0, 0, 0, 0)
            time.sleep(chance.uniform(0.0, 0.01))
            emulator.kill()
    assert found_new > 0, "no save was made"


def test_a_kill_after_an_answer_leaves_what_was_stored_though_the_bench_has_the_same(stored):
    """Of the first bench's motor, and others: each start finds what the last one was told is stored."""
    chance = random.Random(3)
    bench = {"MOT_POLE_PAIRS": 12.0, "MOT_R_MOHM": 108.0, "CTL_BW_CUR_HZ": None}
    emulator = stored()
    with emulator.connect() as esc:
        for name in bench:
            bench[name] = esc.read_param(name).param_value
    emulator.kill()
    asked = dict(bench)
    others = {"MOT_POLE_PAIRS": 14.0, "MOT_R_MOHM": 150.0, "CTL_BW_CUR_HZ": 700.0}
    # Those of the bench over those of another motor, and one of each.
    courses = [others, bench, {**others, "MOT_POLE_PAIRS": 12.0}, bench]
    courses += [
        {name: chance.choice((bench[name], others[name])) for name in bench} for _ in range(4)
    ]
    for course in courses:
        emulator = stored()
        with emulator.connect() as esc:
            time.sleep(TUNE_S)
            assert {name: esc.read_param(name).param_value for name in bench} == asked
            for name, value in course.items():
                esc.set_param(name, value)
            assert esc.command(STORAGE, 1) == ACCEPTED
            emulator.kill()
        asked = course
    with stored().connect() as esc:
        assert {name: esc.read_param(name).param_value for name in bench} == asked


def test_statistics_outlive_a_kill(stored):
    emulator = stored()
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(3000, 3300)
        # The run time is reported in whole seconds, and half throttle may be reached in less than one.
        time.sleep(1.0)
        throttle.value = 0
        time.sleep(2 * QUIET_S)
    emulator.kill()
    with Files(stored().port) as files:
        lines = dict(
            line.split(": ") for line in files.file("@SYS/statistics.txt").decode().splitlines()
        )
    assert lines["Starts"] == "1"
    assert int(lines["Run time"].removesuffix(" s")) >= 1
    assert 1 <= int(lines["Highest phase current"].removesuffix(" A")) <= 28
    assert not [name for name in lines if name.startswith("Fault")]


WORD = 8


def test_a_bit_that_rots_changes_no_setting(stored, tmp_path):
    """Each save is stored twice: otherwise one bit would leave another motor's settings, and arm."""
    path = tmp_path / "flash.bin"
    emulator = stored()
    with emulator.connect() as esc:
        esc.set_param("LIM_PHASE_A", 12.5)
        time.sleep(QUIET_S)
    emulator.kill()
    content = path.read_bytes()
    words = [content[at : at + WORD] for at in range(0, len(content), WORD)]
    used = [at for at, word in enumerate(words) if word != b"\xff" * WORD]
    chance = random.Random(2)
    for at in (used[0], used[len(used) // 2 - 1], used[-1]):
        rotten = bytearray(content)
        rotten[at * WORD + chance.randrange(WORD)] ^= 1 << chance.randrange(8)
        path.write_bytes(rotten)
        emulator = stored()
        with emulator.connect() as esc:
            assert esc.read_param("LIM_PHASE_A").param_value == 12.5, at
        emulator.kill()


@pytest.mark.parametrize("harm", [os.remove, lambda path: os.truncate(path, 100)])
def test_a_file_that_is_gone_is_told_to_who_stores(stored, tmp_path, harm):
    path = tmp_path / "flash.bin"
    emulator = stored()
    with emulator.connect() as esc:
        assert esc.command(STORAGE, 1) == ACCEPTED
        harm(path)
        # Whether there is something to write or not.
        for value in (None, 12.5):
            if value:
                esc.set_param("LIM_PHASE_A", value)
            assert esc.command(STORAGE, 1) == FAILED
        texts = [m.text for m in esc.since(0, "STATUSTEXT")]
        assert "storage: the file was removed or cut" in texts
        # Another start makes a new file; this one has still lost its own.
        if not path.exists():
            with stored().connect():
                assert esc.command(STORAGE, 1) == FAILED


def test_a_second_emulator_on_one_file_is_refused(stored, tmp_path):
    path = tmp_path / "flash.bin"
    with stored().connect():
        second = run("--storage", path, "--mavlink", "none", "--signal", "udp:127.0.0.1:0")
    assert second.returncode == 2
    assert second.stderr.count("\n") == 1, second.stderr
    assert str(path) in second.stderr and "another emulator uses it" in second.stderr


def test_nobody_else_may_read_what_is_stored(stored, tmp_path):
    with stored().connect():
        assert Path(tmp_path / "flash.bin").stat().st_mode & 0o777 == 0o600


def test_an_esc_that_has_lost_its_settings_arms_once_somebody_stores_some(stored, tmp_path):
    """The very first save, cut off in its second word."""
    path = tmp_path / "flash.bin"
    emulator = stored()
    with emulator.connect() as esc:
        esc.set_param("LIM_PHASE_A", 12.5)
        time.sleep(QUIET_S)
    emulator.kill()
    content = path.read_bytes()
    path.write_bytes(content[: 2 * WORD] + b"\xff" * (len(content) - 2 * WORD))
    emulator = stored()
    with emulator.connect() as esc, emulator.throttle():
        time.sleep(QUIET_S)
        assert not esc.armed()
        assert esc.read_param("LIM_PHASE_A").param_value == 20.0
        esc.set_param("LIM_PHASE_A", 12.5)
        time.sleep(QUIET_S)
        assert not esc.armed(), "a value alone restores nothing"
        assert esc.command(STORAGE, 1) == ACCEPTED
        esc.wait_armed()
