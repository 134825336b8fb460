"""Commands: each one addressed to the ESC gets its ACK."""

import math
import time

import pytest

import siskin_dialect as dialect
from dshot import HALF, STOP
from emulator import PATIENT
from esc import gaps_us

ACCEPTED = dialect.MAV_RESULT_ACCEPTED
DENIED = dialect.MAV_RESULT_DENIED
IN_PROGRESS = dialect.MAV_RESULT_IN_PROGRESS
REJECTED = dialect.MAV_RESULT_TEMPORARILY_REJECTED
UNSUPPORTED = dialect.MAV_RESULT_UNSUPPORTED

ARM_DISARM = dialect.MAV_CMD_COMPONENT_ARM_DISARM
ACTUATOR_TEST = dialect.MAV_CMD_ACTUATOR_TEST
MOTOR_TEST = dialect.MAV_CMD_DO_MOTOR_TEST
CALIBRATION = dialect.MAV_CMD_PREFLIGHT_CALIBRATION
CONFIGURE = dialect.MAV_CMD_CONFIGURE_ACTUATOR
INTERVAL = dialect.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST = dialect.MAV_CMD_REQUEST_MESSAGE
STORAGE = dialect.MAV_CMD_PREFLIGHT_STORAGE
REBOOT = dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
ESC_STATUS = dialect.MAVLINK_MSG_ID_ESC_STATUS


@pytest.mark.parametrize("number", [16, 22, 999, 31011, 65535])
def test_what_it_cannot_do_is_unsupported(esc, number):
    assert esc.command(number, 1.0) == UNSUPPORTED


def test_a_command_for_another_gets_no_ack(esc):
    mark = esc.mark()
    esc.codec.command_long_send(9, 1, 999, 0, *[0.0] * 7)
    esc.codec.command_long_send(1, 99, 999, 0, *[0.0] * 7)
    assert esc.command(22) == UNSUPPORTED
    assert len(esc.since(mark, "COMMAND_ACK")) == 1


@pytest.mark.parametrize(
    "name", ["HEARTBEAT", "ESC_INFO", "ESC_STATUS", "ESC_TELEMETRY_1_TO_4", "AUTOPILOT_VERSION"]
)
def test_a_message_is_sent_on_request(esc, name):
    number = getattr(dialect, f"MAVLINK_MSG_ID_{name}")
    if name.startswith("ESC"):
        esc.stream(number, -1)
    mark = esc.mark()
    assert esc.command(REQUEST, number) == ACCEPTED
    assert esc.wait(name, since=mark) is not None


def test_an_unknown_message_is_not_promised(esc):
    assert esc.command(REQUEST, 33) != ACCEPTED
    assert esc.command(INTERVAL, 33, 100_000) != ACCEPTED


def test_an_interval_holds_and_can_be_ended(esc):
    esc.stream(ESC_STATUS, 20_000)
    gaps = gaps_us(esc.statuses(1.0))
    assert all(abs(gap - 20_000) <= 2_000 for gap in gaps), gaps
    esc.stream(ESC_STATUS, -1)
    mark = esc.mark()
    time.sleep(0.5)
    assert esc.since(mark, "ESC_STATUS") == []
    esc.stream(ESC_STATUS, 0)
    gaps = gaps_us(esc.statuses(0.5))
    assert all(abs(gap - 100_000) <= 2_000 for gap in gaps), gaps


def test_arming_by_command_needs_zero_throttle_on_the_wire(start):
    # Long enough that a busy machine does not count as a lost signal.
    emulator = start(*PATIENT)
    with emulator.connect() as esc:
        assert esc.command(ARM_DISARM, 1) == DENIED, "a silent wire"
        with emulator.throttle(HALF) as throttle:
            time.sleep(0.5)
            assert esc.command(ARM_DISARM, 1) == DENIED, "an open throttle"
            throttle.value = STOP
            esc.wait_armed()
            assert esc.command(ARM_DISARM, 1) == ACCEPTED
        esc.wait_armed(False)
        assert esc.command(ARM_DISARM, 1) == DENIED, "a lost signal"


def test_disarming_stops_a_turning_motor_until_zero_throttle(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.stream(ESC_STATUS, 20_000)
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(3000, 3300)
        assert esc.command(ARM_DISARM, 0) == ACCEPTED
        esc.wait_rpm(-100, 100)
        assert max(abs(m.rpm[0]) for m in esc.statuses(0.5)) < 100, "the throttle is still open"
        throttle.value = STOP
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(3000, 3300)


def begin_test(esc, *command: float) -> None:
    """Begins a motor test. While the ESC still plays its start-up tune, it is temporarily rejected."""
    for _ in range(50):
        result = esc.command(*command)
        if result != REJECTED:
            break
        time.sleep(0.1)
    assert result == ACCEPTED


def test_an_actuator_test_turns_the_motor_for_its_time_only(esc):
    esc.stream(ESC_STATUS, 20_000)
    begin_test(esc, ACTUATOR_TEST, 1.0, 2.0, 0, 0, 1)
    begin = esc.status().time_usec
    turning = esc.wait_rpm(100, 6000)
    assert turning.time_usec - begin < 2.1e6
    # Long after its time: 0.1 s from sending to the first step, and 2 s to brake.
    esc.next("ESC_STATUS", lambda m: m.time_usec > begin + 4.2e6)
    assert abs(esc.status().rpm[0]) < 100
    assert not esc.armed()


def stops_within_its_braking(esc) -> None:
    """From the order on, not from the start of the test: on a busy machine time may pass between them."""
    ordered = esc.status().time_usec
    assert esc.wait_rpm(-50, 50).time_usec - ordered < 2.2e6


def test_an_actuator_test_is_ended_by_nan(esc):
    esc.stream(ESC_STATUS, 20_000)
    begin_test(esc, ACTUATOR_TEST, 1.0, 3.0, 0, 0, 1)
    esc.wait_rpm(100, 6000)
    assert esc.command(ACTUATOR_TEST, math.nan, 0, 0, 0, 1) == ACCEPTED
    stops_within_its_braking(esc)


def test_an_actuator_test_has_limits(esc):
    assert esc.command(ACTUATOR_TEST, 1.5, 1.0, 0, 0, 1) == DENIED
    assert esc.command(ACTUATOR_TEST, 0.5, 3.5, 0, 0, 1) == DENIED
    assert esc.command(ACTUATOR_TEST, 0.5, -1.0, 0, 0, 1) == DENIED
    assert esc.command(ACTUATOR_TEST, 0.5, 1.0, 0, 0, 33) == DENIED
    with esc.emulator.throttle(HALF):
        time.sleep(0.5)
        assert esc.command(ACTUATOR_TEST, 0.5, 1.0, 0, 0, 1) == REJECTED, "an open throttle"
    assert abs(esc.status().rpm[0]) < 1


def test_a_motor_test_turns_the_motor_and_one_of_nothing_ends_it(esc):
    esc.stream(ESC_STATUS, 20_000)
    percent, pulse = dialect.MOTOR_TEST_THROTTLE_PERCENT, dialect.MOTOR_TEST_THROTTLE_PWM
    assert esc.command(MOTOR_TEST, 2, percent, 100, 2.0) == DENIED, "another motor"
    for throttle in [(percent, 100), (pulse, 2000)]:
        begin_test(esc, MOTOR_TEST, 1, *throttle, 3.0)
        esc.wait_rpm(100, 6000)
        assert esc.command(MOTOR_TEST, 1, *throttle, 3.0) == REJECTED, "it turns"
        assert esc.command(MOTOR_TEST, 1, percent, 0, 0) == ACCEPTED
        stops_within_its_braking(esc)


def test_a_direction_by_command_survives_a_kill(start, tmp_path):
    storage = tmp_path / "flash.bin"
    for action, name, value in [(5, "MOT_DIR", 1.0), (2, "INP_3D", 1.0)]:
        emulator = start(storage=storage)
        with emulator.connect() as esc:
            assert esc.command(CONFIGURE, action, 0, 0, 0, 1) == ACCEPTED
            assert esc.command(CONFIGURE, 1, 0, 0, 0, 1) == ACCEPTED, "a beep"
        emulator.kill()
        emulator = start(storage=storage)
        with emulator.connect() as esc:
            assert esc.read_param(name).param_value == value
        emulator.kill()


def test_a_calibration_waits_for_the_stick_until_it_is_ended(esc):
    assert esc.command(CALIBRATION, 1) == DENIED, "a gyro"
    assert esc.command(CALIBRATION) == ACCEPTED, "there is none to end"
    assert esc.command(CALIBRATION, 0, 0, 0, 0, 0, 0, 1) == IN_PROGRESS
    assert esc.command(STORAGE, 1) == REJECTED
    mark = esc.mark()
    assert esc.command(CALIBRATION) == dialect.MAV_RESULT_CANCELLED
    assert esc.wait("COMMAND_ACK", lambda m: m.result == ACCEPTED, mark) is not None
    assert esc.command(STORAGE, -1) == ACCEPTED


def test_the_wire_takes_over_from_an_actuator_test(start):
    emulator = start(*PATIENT)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        esc.stream(ESC_STATUS, 20_000)
        esc.wait_armed()
        begin_test(esc, ACTUATOR_TEST, 0.5, 3.0, 0, 0, 1)
        throttle.value = HALF
        esc.wait_rpm(3000, 3300)
        assert esc.command(ACTUATOR_TEST, 0.5, 1.0, 0, 0, 1) == REJECTED, "it turns"


def test_a_reboot_ends_in_the_same_esc(esc):
    esc.set_param("CTL_RPM_MAX", 5000.0)
    mark = esc.mark()
    assert esc.command(REBOOT, 1) == ACCEPTED
    assert esc.wait("STATUSTEXT", lambda m: m.text.startswith("Siskin ESC"), mark) is not None
    assert esc.read_param("CTL_RPM_MAX").param_value == 5000.0, "it was stored before"


def test_stored_parameters_survive_a_kill(start, tmp_path):
    storage = tmp_path / "flash.bin"
    emulator = start(storage=storage)
    with emulator.connect() as esc:
        assert storage.exists(), "a missing file is created"
        assert esc.set_param("LIM_PHASE_A", 12.5) == 12.5
        assert esc.command(STORAGE, 1) == ACCEPTED
    emulator.kill()
    with start(storage=storage).connect() as esc:
        assert esc.read_param("LIM_PHASE_A").param_value == 12.5
        assert esc.command(STORAGE, 2) == ACCEPTED
        assert esc.read_param("LIM_PHASE_A").param_value == 20.0


def test_reading_the_storage_brings_its_values_back(start, tmp_path):
    emulator = start(storage=tmp_path / "flash.bin")
    with emulator.connect() as esc:
        esc.set_param("LIM_PHASE_A", 12.5)
        assert esc.command(STORAGE, 1) == ACCEPTED
        esc.set_param("LIM_PHASE_A", 15.0)
        assert esc.command(STORAGE, 0) == ACCEPTED
        assert esc.read_param("LIM_PHASE_A").param_value == 12.5


def test_storage_none_does_not_promise_what_would_not_survive(esc):
    assert esc.command(STORAGE, 1) != ACCEPTED
