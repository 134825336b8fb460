"""The Python module: what surrounds its ESCs, their parameters, MAVLink, faults and recordings."""

import csv
import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

import siskin
from emulator import run
from paths import SCENARIOS

BLADE_NM_S2 = 0.3e-6
"""The default bench's propeller: its torque over the square of its speed."""


@pytest.fixture
def two():
    """Two ESCs at half throttle on a pack."""
    emulator = siskin.Emulator("bosso", escs=2, bus="6s", record=True)
    emulator.advance(0.4)
    emulator.throttle[:] = 0.5
    emulator.advance(1.6)
    return emulator


def means(emulator: siskin.Emulator) -> list[float]:
    emulator.advance(0.1)
    return [esc.torque_nm for esc in emulator.state]


def test_the_environment_acts(two):
    calm_nm = means(two)[0]
    two.environment(supply_v=20.0, supply_ohm=0.05, ambient_c=60.0, torque_nm=[-0.02, None], wind_rpm=[None, 1500.0])
    two.advance(1.0)
    pulled_nm, blown_nm = means(two)
    speed, wind = (rpm * math.pi / 30 for rpm in (two.state[1].rpm, 1500.0))
    eased_nm = BLADE_NM_S2 * (speed**2 - (speed - wind) ** 2)
    # The speed is held: the torque follows what acts on the shaft, with less than a mNm of ripple over 0.1 s.
    assert pulled_nm - calm_nm == pytest.approx(0.02, abs=1e-3)
    assert calm_nm - blown_nm == pytest.approx(eased_nm, abs=1e-3)
    state = two.state[0]
    drawn_a = sum(esc.bus_a for esc in two.state)
    assert state.bus_v == pytest.approx(20.0 - 0.05 * drawn_a, abs=0.02) and drawn_a > 1.0
    assert state.reported.bus_v == pytest.approx(state.bus_v, abs=0.2)
    assert state.board_c > 25.3
    # What is left out stays.
    two.environment(wind_rpm=0.0)
    two.advance(0.5)
    assert means(two)[0] == pytest.approx(pulled_nm, abs=1e-3) and two.state[0].bus_v < 20.0


def test_parameters_are_a_mapping():
    emulator = siskin.Emulator("bosso", escs=3, params={"CTL_RPM_MAX": 5000})
    params = emulator.params
    assert len(params) == len(siskin.PARAMETERS) > 50 and set(params) == set(siskin.PARAMETERS)
    assert params["CTL_RPM_MAX"] == 5000 and params.of(2)["MAV_COMP_ID"] == 142
    params["CTL_RPM_MAX"] = 4000
    params.of(1)["CTL_RPM_MAX"] = 3000
    assert [params.of(esc)["CTL_RPM_MAX"] for esc in range(3)] == [4000, 3000, 4000]
    emulator.advance(0.4)
    emulator.throttle[:] = 1.0
    emulator.advance(2.0)
    for esc, wanted in zip(emulator.state, [4000, 3000, 4000]):
        assert abs(esc.rpm - wanted) < 0.01 * wanted
    for name, value, said in [
        ("CTL_RPM_MAX", 1.0, "CTL_RPM_MAX = 1 is out of range; give 100 to 200000 rpm"),
        ("MOT_KV", 100.0, "MOT_KV is computed and cannot be set"),
        ("MOT_DIR", 0.5, "MOT_DIR = 0.5 is not a whole number"),
        ("MOT_POLE_PAIRS", 7, "MOT_POLE_PAIRS = 7 is refused: the motor turns"),
    ]:
        with pytest.raises(siskin.Error) as raised:
            params[name] = value
        assert str(raised.value) == said
    for attempt in (lambda: params["NO_SUCH"], lambda: params.update(NO_SUCH=1)):
        with pytest.raises(KeyError, match="there is no parameter NO_SUCH"):
            attempt()
    with pytest.raises(TypeError, match="cannot be deleted"):
        del params["CTL_MODE"]
    with pytest.raises(siskin.Error) as raised:
        siskin.Emulator("bosso", params={"CTL_RPM_MAX": 1})
    ended = run("--param", "CTL_RPM_MAX=1", "--mavlink", "none", "--duration", 0)
    assert str(raised.value) in ended.stderr


def test_settings_are_stored_where_a_file_is_given(tmp_path):
    for _ in range(2):
        emulator = siskin.Emulator("bosso", escs=2, storage=tmp_path / "flash")
        stored = [emulator.params.of(esc)["LIM_TEMP_C"] for esc in (0, 1)]
        emulator.params.of(1)["LIM_TEMP_C"] = 77.0
        emulator.throttle[:] = None
        # Settings store themselves some seconds after the last change.
        emulator.advance(30.0)
        # The file is free for others once it is gone.
        del emulator
    assert stored[1] == 77.0 != stored[0]
    (tmp_path / "flash.1").write_bytes(b"no flash")
    with pytest.raises(siskin.Error, match="flash.1: the file is corrupt"):
        siskin.Emulator("bosso", escs=2, storage=tmp_path / "flash")


def test_pymavlink_takes_the_pipe():
    emulator = siskin.Emulator("bosso", escs=4, bus="6s")
    # Its parser and its sender, on bytes alone.
    link = ardupilotmega.MAVLink(emulator.mavlink, srcSystem=255)
    link.param_request_read_send(1, 142, b"CTL_MODE", -1)
    emulator.advance(1.5)
    messages = link.parse_buffer(emulator.mavlink.read())
    assert {m.get_srcComponent() for m in messages if m.get_type() == "HEARTBEAT"} == {140, 141, 142, 143}
    values = [m for m in messages if m.get_type() == "PARAM_VALUE"]
    assert [(m.get_srcComponent(), m.param_id) for m in values] == [(142, "CTL_MODE")]
    assert emulator.mavlink.read() == b""
    assert emulator.mavlink.write(b"\xfd") == 1


def test_mavutil_takes_a_connection_and_waits_in_simulated_time(two):
    connection = two.mavlink.connection()
    before_s = two.time_s
    telemetry = connection.recv_match(type="ESC_TELEMETRY_1_TO_4", blocking=True, timeout=60)
    assert [abs(rpm - 3150) < 32 for rpm in telemetry.rpm[:2]] == [True, True]
    assert abs(telemetry.voltage[0] / 100 - two.state[0].bus_v) < 0.1
    connection.mav.param_request_read_send(1, 141, b"MAV_COMP_ID", -1)
    value = connection.recv_match(type="PARAM_VALUE", blocking=True, timeout=60)
    assert value.get_srcComponent() == value.param_value == 141
    # What it waited for came in simulated time.
    assert before_s < two.time_s < before_s + 10.0


def test_what_nobody_reads_is_forgotten_by_whole_frames():
    emulator = siskin.Emulator("bosso", escs=4)
    emulator.advance(60.0)
    waiting = emulator.mavlink.read()
    assert 60_000 < len(waiting) <= 65_536
    link = ardupilotmega.MAVLink(None)
    link.robust_parsing = False
    beats = [m for m in link.parse_buffer(waiting) if m.get_type() == "HEARTBEAT"]
    assert len(beats) > 20 and link.total_receive_errors == 0


def test_faults_come_and_are_mended(two):
    two.faults.inject(1, "rotor_blocked", for_s=5.0)
    two.faults.inject(0, "sensor_stuck", phase=1, value=3.5, at_s=100.0)
    assert two.faults[:] == [
        ['kind = "sensor_stuck", phase = 1, value = 3.5, at_s = 100.0'],
        ['kind = "rotor_blocked", at_s = 2.0, for_s = 5.0'],
    ]
    two.advance(0.5)
    assert two.state[1].rpm == 0.0 and two.state[0].rpm > 3000
    two.faults.mend(1)
    assert two.faults[1] == [] and len(two.faults[0]) == 1
    two.faults.inject(0, "mosfet_short", phase=2, side="low")
    # Before the first retry.
    two.advance(0.01)
    assert two.state[0].phase == "idle" and two.state[0].faults == ["over-current"]
    # An expired one is gone.
    two.faults.inject(1, "signal_loss", for_s=0.05)
    assert len(two.faults[1]) == 1
    two.advance(0.2)
    assert two.faults[1] == []
    with pytest.raises(siskin.Error, match="unknown variant `rust`, expected one of `rotor_blocked`"):
        two.faults.inject(0, "rust")


def test_a_recording_is_the_program_s(tmp_path):
    path = tmp_path / "steps.csv"
    siskin.scenario(SCENARIOS / "first-spin.toml", record=path)
    with path.open(newline="") as file:
        assert next(csv.reader(file)) == list(siskin.dtype.names)


def test_a_recording_has_every_control_period(two):
    rows = two.record(1)
    assert rows.dtype == siskin.dtype and len(two.record(1)) == 0
    # 24 kHz is what follows from this motor where PWM_FREQ_HZ is 0.
    assert len(rows) == pytest.approx(2.0 * 24_000, abs=2)
    assert rows["t_s"][0] == 0.0 and np.all(np.diff(rows["t_s"]) > 0)
    assert {siskin.PHASES[phase] for phase in np.unique(rows["phase"])} >= {"idle", "park", "ramp", "run"}
    assert rows["rpm"][-1] == pytest.approx(two.state[1].rpm, abs=1.0)
    assert rows["bus_v"][-1] == pytest.approx(two.state[1].bus_v, abs=0.01)
    # Star currents sum to zero, and the bridge is off at first.
    assert np.abs(rows["i_a_a"] + rows["i_b_a"] + rows["i_c_a"]).max() < 1e-3
    assert np.isnan(rows["duty_a"][0]) and not np.isnan(rows["duty_a"][-1])
    steady = rows[rows["t_s"] > 1.8]
    assert np.abs(steady["angle_error_deg"]).max() < 10
    assert len(two.record(0)) == len(rows)
