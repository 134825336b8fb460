"""What a flight controller gets back, in real time: speed, extended telemetry, KISS telemetry.

When a reply begins, and that every frame has one, is tested in simulated time.
"""

import time

from dshot import (
    BIDIRECTIONAL_DSHOT600,
    EXTENDED_OFF,
    EXTENDED_ON,
    HALF,
    KISS,
    STANDS,
    STOP,
    crc8,
    erpm,
    is_extended,
)
from emulator import PATIENT
from esc import TIMEOUT_S

POLE_PAIRS = 12


def until(wanted) -> None:
    """Waits for a condition; fails the test if it does not come true."""
    end = time.monotonic() + TIMEOUT_S
    while not wanted():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.01)


def settle(esc) -> None:
    """Waits until half throttle's speed is held."""
    esc.wait_rpm(3100, 3200)
    esc.statuses(0.5)


def fly(start):
    """Starts an emulator on a bidirectional wire that it detects by itself."""
    emulator = start(*PATIENT)
    return emulator, emulator.throttle(protocol=BIDIRECTIONAL_DSHOT600)


def test_it_arms_spins_and_tells_its_speed(start):
    emulator, throttle = fly(start)
    with emulator.connect() as esc, throttle:
        esc.wait_armed()
        assert set(throttle.replies()) == {STANDS}
        throttle.value = HALF
        settle(esc)
        before = len(throttle.answers)
        statuses = esc.statuses(1.0)
        told = [erpm(data) / POLE_PAIRS for data in throttle.replies(before)]
        assert len(told) > 100
        rpm = [m.rpm[0] for m in statuses]
        # A turn of 1587 µs is reported in steps of 4, and the speed itself varies.
        assert min(rpm) * 0.995 < min(told) and max(told) < max(rpm) * 1.005, (min(told), max(told))
        assert {answer[0] for answer in throttle.answers} == {BIDIRECTIONAL_DSHOT600}
        # From the frame's end to the first edge, ns.
        after = {int.from_bytes(answer[5:9], "little") for answer in throttle.answers}
        assert 29_900 < min(after) and max(after) < 30_100, after


def test_extended_telemetry_is_turned_on_and_off(start):
    emulator, throttle = fly(start)
    with emulator.connect() as esc, throttle:
        esc.wait_armed()
        throttle.value = EXTENDED_ON
        until(lambda: 0xE00 in throttle.replies())
        throttle.value = STOP
        on = len(throttle.answers)
        until(lambda: len(throttle.replies(on)) > 1500)
        replies = throttle.replies(on)
        for pair in zip(replies, replies[1:]):
            assert not (is_extended(pair[0]) and is_extended(pair[1])), pair
        words = {data >> 8: data & 0xFF for data in replies if is_extended(data)}
        assert set(words) == {0x2, 0x4, 0x6, 0xC, 0xE}
        assert abs(words[0x4] * 0.25 - 24.0) <= 0.5
        assert 15 <= words[0x2] <= 60 and words[0x6] == words[0xC] == words[0xE] == 0, words

        throttle.value = EXTENDED_OFF
        until(lambda: 0xEFF in throttle.replies(on))
        throttle.value = STOP
        off = len(throttle.answers) + 10
        until(lambda: len(throttle.replies(off)) > 1500)
        assert set(throttle.replies(off)) == {STANDS}


def test_the_telemetry_bit_brings_a_kiss_frame(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.wait_armed()
        assert not throttle.answers, "nobody has asked"
        throttle.value = HALF
        settle(esc)
        throttle.telemetry = True
        until(lambda: len(throttle.answers) > 20)
        throttle.telemetry = False
        status = esc.status()
        for answer in list(throttle.answers):
            assert answer[0] == KISS and len(answer) == 11
            assert crc8(answer[1:]) == 0
            words = [int.from_bytes(answer[i : i + 2], "big") for i in (2, 4, 6, 8)]
            volts, amperes, erpm_100 = words[0] / 100, words[1] / 100, words[3]
            assert 15 <= answer[1] <= 60 and abs(volts - status.voltage[0]) < 0.2
            assert abs(amperes - status.current[0]) < 1.0
            assert abs(erpm_100 * 100 / POLE_PAIRS - status.rpm[0]) < 40
