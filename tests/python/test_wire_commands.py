"""What a flight controller orders by DShot commands and a pilot by the stick, over the socket.

Exact counts and times are in the control's own tests; these show the way from the socket to MAVLink and to the
storage.
"""

import socket
import struct
import time

import siskin_dialect as dialect
from dshot import HALF
from test_throttle import PATIENT, stands

REVERSED, SAVE, DIRECTION_2 = 1.0, 12, 8
REPEATS = 10
"""How often flight controllers send a command, 1 ms apart."""


def wait_text(esc, text: str, since: int = 0):
    """Returns the STATUSTEXT that says this, from the mark on."""
    found = esc.wait("STATUSTEXT", lambda m: m.text == text, since)
    said = [m.text for m in esc.since(since, "STATUSTEXT")]
    assert found is not None, f"not said: {text}; but: {said}"
    return found


def order(throttle, command: int) -> None:
    """Sends a command often enough, in place of zero throttle."""
    before = throttle.sent
    throttle.value = command
    until = time.monotonic() + 10.0
    while throttle.sent < before + REPEATS and time.monotonic() < until:
        time.sleep(0.001)
    throttle.value = 0


def pulses(port: int, seconds: float, width_us: int) -> None:
    """Sends servo pulses, 50 a second."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        for _ in range(int(seconds * 50)):
            wire.sendto(struct.pack("<BI", 0, width_us * 1000), ("127.0.0.1", port))
            time.sleep(0.02)


def test_the_signal_is_named_and_its_loss_is_told(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc:
        with emulator.throttle():
            wait_text(esc, "Throttle: DShot600")
            esc.wait_armed()
        lost = wait_text(esc, "Throttle: signal lost while armed")
        assert lost.severity == dialect.MAV_SEVERITY_WARNING
        esc.wait_armed(False)


def test_an_open_throttle_is_told_again_and_again_and_never_turns(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle(value=HALF):
        text = "Throttle is open: lower it to arm"
        wait_text(esc, text)
        mark = esc.mark()
        wait_text(esc, text, mark)
        assert stands(esc)
        assert not esc.armed()


def test_a_direction_by_command_is_told_and_survives_when_it_was_saved(start, tmp_path):
    storage = tmp_path / "flash"
    emulator = start(*PATIENT, storage=storage)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.wait_armed()
        mark = esc.mark()
        order(throttle, DIRECTION_2)
        told = esc.wait("PARAM_VALUE", lambda m: m.param_id == "MOT_DIR", mark)
        assert told is not None and told.param_value == REVERSED
        assert not esc.since(mark, "COMMAND_ACK")
        order(throttle, SAVE)
        wait_text(esc, "Parameters stored", mark)
        assert not esc.since(mark, "COMMAND_ACK"), "nobody has asked by MAVLink"
    emulator.kill()
    with start(storage=storage).connect() as esc:
        assert esc.read_param("MOT_DIR").param_value == REVERSED


def test_a_command_to_a_turning_motor_changes_nothing(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(3000, 3300)
        mark = esc.mark()
        order(throttle, DIRECTION_2)
        throttle.value = HALF
        assert esc.read_param("MOT_DIR").param_value == 0.0
        assert len(esc.since(mark, "PARAM_VALUE")) == 1, "the one that was asked for"
        esc.wait_rpm(3000, 3300)


def test_the_share_of_bad_frames_is_in_the_telemetry(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.wait_armed()
        clean = esc.next("NAMED_VALUE_FLOAT")
        assert (clean.name, clean.value) == ("bad_frames", 0.0)
        throttle.bad_crc = True
        esc.next("NAMED_VALUE_FLOAT", lambda m: m.value == 100.0)
        throttle.bad_crc = False
        esc.next("NAMED_VALUE_FLOAT", lambda m: m.value == 0.0)


def test_the_stick_teaches_its_ends(start, tmp_path):
    storage = tmp_path / "flash"
    emulator = start(*PATIENT, storage=storage)
    port = emulator.signal_port
    with emulator.connect() as esc:
        pulses(port, 4.0, 1900)
        wait_text(esc, "Stick calibration: full taken, now lower it")
        pulses(port, 0.3, 1500)
        pulses(port, 2.5, 1120)
        wait_text(esc, "Stick calibration: both ends taken")
        wait_text(esc, "Parameters stored")
        assert stands(esc)
    emulator.kill()
    with start(storage=storage).connect() as esc:
        ends = [esc.read_param(f"INP_PULSE_{end}_US").param_value for end in ("MIN", "MAX")]
        # The emulated timer's pulse ends are exact to its tick.
        assert ends == [1120.0, 1900.0]
