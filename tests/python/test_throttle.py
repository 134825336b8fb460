"""From frames on the throttle wire to the speed in the telemetry, in real time.

What must hold to the millisecond is in the scenarios, in simulated time. Here the flight controller is a thread on a
busy machine, so gaps between its frames may exceed `INP_LOSS_MS`: where a test is not about that, it is set to 500 ms.
"""

import random
import socket
import struct
import time

import pytest

import siskin_dialect as dialect
from dshot import DSHOT150, DSHOT300, DSHOT600, HALF, LEAST, MOST, RAW_EDGES, STOP, datagram, frame
from emulator import PATIENT
from esc import Esc

STANDS_RPM = 100

CURRENT_SETTLED_US = 1_000_000
"""After this time the reported current, a mean over 0.2 s, has forgotten what came before."""


def spin(esc, throttle):
    """Waits until armed, then brings the motor to half throttle's speed."""
    esc.wait_armed()
    throttle.value = HALF
    esc.wait_rpm(3000, 3300)


def rpm_of(value: int) -> float:
    """The default mapping from throttle in speed mode."""
    return 300.0 + (value - LEAST) / (MOST - LEAST) * 5700.0


def fast(esc: Esc) -> None:
    """Requests a status every 10 ms, to see when things happen."""
    esc.stream(dialect.MAVLINK_MSG_ID_ESC_STATUS, 10_000)
    esc.status()


def stands(esc: Esc, seconds: float = 1.0) -> bool:
    """Returns whether the shaft stands still for a while."""
    return all(m.rpm[0] == 0 for m in esc.statuses(seconds))


def test_half_throttle_reaches_its_speed_holds_it_and_stops(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        fast(esc)
        esc.wait_armed()
        begin = esc.status().time_usec
        throttle.value = HALF
        # The last status before the throttle opened is up to 10 ms old.
        reached = esc.statuses(2.5)
        after = [m.rpm[0] for m in reached if m.time_usec >= begin + 1.52e6]
        assert abs(after[0] - 3150.0) <= 31.5, after[0]
        held = [m.rpm[0] for m in esc.statuses(1.5)]
        assert all(abs(rpm - 3150.0) <= 15.75 for rpm in held), (min(held), max(held))
        throttle.value = STOP
        begin = esc.status().time_usec
        esc.wait_rpm(-STANDS_RPM, STANDS_RPM)
        assert esc.status().time_usec - begin < 2.2e6


@pytest.mark.parametrize("protocol", [DSHOT150, DSHOT300, DSHOT600])
def test_every_rate_arms_and_turns(start, protocol):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle(protocol=protocol) as throttle:
        esc.wait_armed()
        throttle.value = 548
        expected = rpm_of(548)
        esc.wait_rpm(0.99 * expected, 1.01 * expected)


@pytest.mark.parametrize("value", [LEAST, MOST])
def test_the_ends_of_the_throttle_are_the_ends_of_the_speed(start, value):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.wait_armed()
        throttle.value = value
        expected = rpm_of(value)
        esc.wait_rpm(0.98 * expected, 1.02 * expected)


def test_a_lost_signal_stops_the_motor_and_needs_arming_again(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        fast(esc)
        spin(esc, throttle)
        throttle.value = None
        begin = esc.status().time_usec
        still = esc.wait_rpm(-STANDS_RPM, STANDS_RPM)
        assert still.time_usec - begin < 2.7e6
        off = esc.next("ESC_STATUS", lambda m: m.time_usec >= begin + CURRENT_SETTLED_US)
        assert off.current[0] <= 0.05, "a driving current"
        throttle.value = HALF
        rest = esc.statuses(1.0)
        assert max(abs(m.rpm[0]) for m in rest) < STANDS_RPM, "it was not armed"


def test_a_throttle_that_is_open_at_power_up_does_not_turn_the_motor(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle(HALF) as throttle:
        assert stands(esc, 1.5)
        assert not esc.armed()
        throttle.value = STOP
        spin(esc, throttle)


@pytest.mark.parametrize("value", [STOP, HALF])
def test_frames_with_a_bad_check_sum_neither_arm_nor_turn(start, value):
    emulator = start(*PATIENT)
    throttle = emulator.throttle(STOP)
    throttle.bad_crc = True
    with emulator.connect() as esc, throttle:
        assert stands(esc, 1.0)
        assert not esc.armed()
        throttle.value = value
        assert stands(esc, 1.0)
        assert not esc.armed()
        before = throttle.sent
        # The next one may already be on its way, without them.
        esc.next("ESC_INFO")
        counted = esc.next("ESC_INFO").error_count[0]
        assert before <= counted <= throttle.sent, "each is counted once"


def test_bad_frames_alone_are_a_lost_signal(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        fast(esc)
        spin(esc, throttle)
        throttle.bad_crc = True
        esc.wait_rpm(-STANDS_RPM, STANDS_RPM)


def test_commands_hold_the_arming_and_do_not_turn(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle(value=30) as throttle:
        esc.wait_armed()
        throttle.value = 1
        assert stands(esc)
        assert esc.armed()


def test_with_mot_stop_0_the_motor_coasts(start):
    emulator = start(*PATIENT, "--param", "MOT_STOP=0")
    with emulator.connect() as esc, emulator.throttle() as throttle:
        fast(esc)
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(3100, 3200)
        throttle.value = STOP
        begin = esc.status().time_usec
        off = esc.next("ESC_STATUS", lambda m: m.time_usec >= begin + CURRENT_SETTLED_US)
        assert abs(off.current[0]) <= 0.05, "the bridge is off"
        assert off.rpm[0] > STANDS_RPM, "nothing brakes it"


def raw_frame(value: int, bit_ns: int) -> bytes:
    """Returns a frame as levels, beginning and ending low: a one is high for 3/4 of its bit."""
    levels = [200_000]
    for bit in range(15, -1, -1):
        high = bit_ns * (6 if frame(value) >> bit & 1 else 3) // 8
        levels += [high, bit_ns - high]
    levels[-1] += 100_000
    return struct.pack(f"<BB{len(levels)}I", RAW_EDGES, 0, *levels)


def send(port: int, datagrams) -> None:
    """Sends datagrams a millisecond apart."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        for data in datagrams:
            wire.sendto(data, ("127.0.0.1", port))
            time.sleep(0.001)


def test_raw_edges_are_decoded_like_frames(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc:
        send(emulator.signal_port, [raw_frame(STOP, 1667)] * 600)
        # The heartbeat after the last frame comes within the loss time or a second later.
        mark = esc.mark()
        send(emulator.signal_port, [raw_frame(STOP, 1667)] * 1200)
        beats = esc.since(mark, "HEARTBEAT")
        flag = dialect.MAV_MODE_FLAG_SAFETY_ARMED
        assert any(m.base_mode & flag for m in beats), f"{len(beats)} heartbeats, none armed"


def test_datagrams_of_any_length_and_content_do_no_harm(start):
    emulator = start(*PATIENT)
    noise = random.Random(1)
    protocols = [*range(4), *range(10, 14), *range(20, 24), 30, 99, 254, 255]
    lengths = [*range(12), 33, 64, 129, 1000, 1472]
    datagrams = [bytes([p]) + noise.randbytes(n) for p in protocols for n in lengths]
    datagrams += [b"", noise.randbytes(65_507), bytes([RAW_EDGES, 0]) + bytes(65_504)]
    datagrams += [bytes([RAW_EDGES, 1]) + b"\xff" * 4]
    noise.shuffle(datagrams)
    with emulator.connect() as esc:
        send(emulator.signal_port, datagrams)
        assert stands(esc)
        assert not esc.armed()
        with emulator.throttle() as throttle:
            spin(esc, throttle)


def test_a_flood_of_frames_is_dropped_and_the_esc_goes_on(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            for _ in range(20_000):
                wire.sendto(datagram(HALF, DSHOT150), ("127.0.0.1", emulator.signal_port))
        assert stands(esc)
        with emulator.throttle() as throttle:
            spin(esc, throttle)


def test_a_fault_on_the_bench_latches_until_zero_throttle(start):
    emulator = start(*PATIENT, "--param", "LIM_POLICY=0")
    with emulator.connect() as esc, emulator.throttle() as throttle:
        fast(esc)
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(3100, 3200)
        mark = esc.mark()
        # Half throttle takes 3 A, and 1.4 times the limit trips.
        assert esc.set_param("LIM_PHASE_A", 0.5) == 0.5
        assert esc.wait("STATUSTEXT", lambda m: m.text.startswith("Fault: "), mark) is not None
        assert esc.wait("ESC_INFO", lambda m: m.failure_flags[0] != 0, mark) is not None
        assert esc.set_param("LIM_PHASE_A", 20.0) == 20.0
        begin = esc.status().time_usec
        off = esc.next("ESC_STATUS", lambda m: m.time_usec >= begin + CURRENT_SETTLED_US)
        assert abs(off.current[0]) < 0.05, "the bridge is off"
        assert esc.next("ESC_INFO").failure_flags[0] != 0, "the throttle is still open"
        throttle.value = STOP
        ended = esc.next("STATUSTEXT", lambda m: m.text.startswith("Fault ended: "))
        assert ended.severity == dialect.MAV_SEVERITY_NOTICE
        esc.next("ESC_INFO", lambda m: m.failure_flags[0] == 0)
        esc.wait_armed()
        esc.wait_rpm(-STANDS_RPM, STANDS_RPM)
        throttle.value = HALF
        esc.wait_rpm(3100, 3200)


def test_a_sender_that_simulated_time_outruns_is_told_so(start):
    emulator = start(speed="max")
    with emulator.throttle():
        deadline = time.monotonic() + 20.0
        while "lost signal" not in emulator.output() and time.monotonic() < deadline:
            time.sleep(0.1)
    told = [line for line in emulator.output().splitlines() if "lost signal" in line]
    assert len(told) == 1 and "give --speed 1" in told[0], emulator.output()


def test_a_machine_that_falls_behind_real_time_says_so(start):
    # No machine is that fast.
    emulator = start(speed=1000)
    deadline = time.monotonic() + 20.0
    while "too slow" not in emulator.output() and time.monotonic() < deadline:
        time.sleep(0.1)
    assert "of the speed asked for" in emulator.output()
