"""How the ESC introduces itself, and what it sends unasked."""

import siskin_dialect as dialect
from esc import gaps_us


def test_a_heartbeat_a_second_from_a_vehicle_of_its_own(esc):
    mark = esc.mark()
    begin = esc.status().time_usec
    end = esc.next("ESC_STATUS", lambda m: m.time_usec >= begin + 5e6).time_usec
    beats = esc.since(mark, "HEARTBEAT")
    # In the ESC's own time.
    seconds = (end - begin) / 1e6
    assert abs(len(beats) - seconds) <= 1.2, f"{len(beats)} heartbeats in {seconds:.1f} s"
    first = beats[0]
    assert (first.get_srcSystem(), first.get_srcComponent()) == (1, 1)
    assert first.type == dialect.MAV_TYPE_GENERIC
    assert first.autopilot == dialect.MAV_AUTOPILOT_GENERIC
    assert first.system_status == dialect.MAV_STATE_STANDBY
    assert not first.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED
    assert first.mavlink_version == 3


def test_a_peripheral_is_component_140_and_takes_the_system_of_its_autopilot(start):
    emulator = start("--param", "MAV_ROLE=1", "--param", "MAV_COMP_ID=142")
    with emulator.connect(component=142) as esc:
        own = esc.next("HEARTBEAT")
        assert (own.get_srcSystem(), own.get_srcComponent()) == (1, 142)
        assert own.type == dialect.MAV_TYPE_SERVO
        assert own.autopilot == dialect.MAV_AUTOPILOT_INVALID
        autopilot = dialect.MAVLink(esc, srcSystem=7, srcComponent=1)
        autopilot.heartbeat_send(
            dialect.MAV_TYPE_QUADROTOR, dialect.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, 0, 0
        )
        esc.next("HEARTBEAT", lambda m: m.get_srcSystem() == 7)
        esc.system = 7
        assert esc.read_param("MAV_SYS_ID").param_value == 1.0


def test_telemetry_comes_at_its_rates_in_simulated_time(esc):
    esc.statuses(3.2)
    # From the end of the first second: the burst at the start shares the link.
    status = gaps_us(esc.since(0, "ESC_STATUS"))[10:]
    info = gaps_us(esc.since(0, "ESC_INFO"))
    assert len(status) >= 20 and len(info) >= 2
    assert all(abs(gap - 100_000) <= 2_000 for gap in status), status
    assert all(abs(gap - 1_000_000) <= 2_000 for gap in info[1:]), info
    telemetry = len(esc.since(0, "ESC_TELEMETRY_1_TO_4"))
    assert abs(telemetry - len(esc.since(0, "ESC_STATUS"))) <= 2


def test_esc_info_and_status_describe_one_esc_at_rest_on_24_volts(esc):
    info = esc.next("ESC_INFO")
    assert (info.index, info.count, info.info) == (0, 1, 1)
    assert info.connection_type == dialect.ESC_CONNECTION_TYPE_DSHOT
    assert info.failure_flags == [0, 0, 0, 0]
    assert 1_000 <= info.temperature[0] <= 6_000, "hundredths of a degree"
    assert info.temperature[1:] == [32_767] * 3
    # By then the supply's mean has settled from power-up.
    status = esc.next("ESC_STATUS", lambda m: m.time_usec >= 1e6)
    assert status.index == 0
    assert status.rpm == [0, 0, 0, 0]
    assert abs(status.voltage[0] - 24.0) < 0.2
    assert abs(status.current[0]) < 0.2
    telemetry = esc.next("ESC_TELEMETRY_1_TO_4")
    assert abs(telemetry.voltage[0] - 2400) < 20, "hundredths of a volt"
    assert telemetry.rpm == [0, 0, 0, 0]


def test_tel_rate_hz_changes_the_rate_at_once(esc):
    assert esc.set_param("TEL_RATE_HZ", 50.0) == 50.0
    esc.status()
    gaps = gaps_us(esc.statuses(1.0))
    assert all(abs(gap - 20_000) <= 2_000 for gap in gaps), gaps
