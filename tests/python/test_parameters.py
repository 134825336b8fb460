"""The parameter protocol."""

import math
import time

import pytest

import siskin_dialect as dialect

FIXED_NAMES = """
MAV_SYS_ID MAV_COMP_ID MAV_ROLE MOT_POLE_PAIRS MOT_R_MOHM MOT_L_UH MOT_FLUX_MWB MOT_J_GCM2 MOT_DIR
MOT_KV MOT_STOP CTL_MODE CTL_DRIVE CTL_OBSERVER CTL_REGULATOR CTL_MODULATION CTL_OBS_CURE CTL_ADAPT_L
CTL_RPM_MAX CTL_RPM_MIN CTL_SLEW_RPM_S CTL_BW_CUR_HZ CTL_BW_SPD_HZ PWM_FREQ_HZ PWM_DEADTIME_NS
INP_PROTO INP_3D INP_ARM_MS INP_LOSS_MS INP_PULSE_MIN_US INP_PULSE_MAX_US LIM_PHASE_A LIM_BUS_A LIM_REGEN_A LIM_BUS_V_MIN LIM_BUS_V_MAX LIM_TEMP_C STA_PARK_AS
STA_RAMP_A STA_RAMP_RPM_S STA_RUN_RPM TEL_RATE_HZ
""".split()

DEFAULTS = {
    "INP_ARM_MS": 300.0,
    "INP_LOSS_MS": 100.0,
    "CTL_RPM_MIN": 300.0,
    "CTL_RPM_MAX": 6000.0,
    "PWM_FREQ_HZ": 0.0,
    "MOT_STOP": 1.0,
    "CTL_OBSERVER": 3.0,
    "CTL_REGULATOR": 1.0,
    "TEL_RATE_HZ": 10.0,
}


def test_the_list_has_every_parameter_once_and_as_real32(esc):
    values = esc.params()
    assert set(FIXED_NAMES) <= set(values)
    for name, default in DEFAULTS.items():
        assert values[name] == default, name
    assert abs(values["MOT_KV"] - 353.0) < 1.0
    assert all(math.isfinite(value) for value in values.values())
    sent = esc.since(0, "PARAM_VALUE")
    assert {m.param_type for m in sent} == {dialect.MAV_PARAM_TYPE_REAL32}
    assert {m.param_count for m in sent} == {len(values)}


def test_each_is_read_by_name_and_by_index(esc):
    values = esc.params()
    for index, (name, value) in enumerate(values.items()):
        by_name = esc.read_param(name)
        assert (by_name.param_index, by_name.param_value) == (index, value)
        by_index = esc.read_param(index=index)
        assert (by_index.param_id, by_index.param_value) == (name, value)


def test_an_unknown_name_or_index_is_an_error(esc):
    for name, index in (("NO_SUCH_NAME", -1), ("", 999)):
        mark = esc.mark()
        esc.codec.param_request_read_send(1, 1, name.encode(), index)
        error = esc.wait("PARAM_ERROR", since=mark)
        assert error is not None, f"{name} {index}"
        assert (error.param_id, error.param_index) == (name, index)
        assert error.error == dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST


def test_a_set_value_is_told_to_every_client(esc):
    with esc.emulator.connect() as other:
        other.next("HEARTBEAT")
        assert esc.set_param("CTL_RPM_MAX", 5000.0) == 5000.0
        told = other.wait("PARAM_VALUE", lambda m: m.param_id == "CTL_RPM_MAX")
        assert told is not None and told.param_value == 5000.0
        assert other.read_param("CTL_RPM_MAX").param_value == 5000.0


@pytest.mark.parametrize(
    "name, value",
    [
        ("LIM_PHASE_A", -1.0),
        ("LIM_PHASE_A", 1e9),
        ("LIM_PHASE_A", math.nan),
        ("LIM_PHASE_A", math.inf),
        ("MOT_POLE_PAIRS", 7.5),
        ("MOT_STOP", 2.0),
        ("CTL_MODE", 3.0),
        ("CTL_DRIVE", 3.0),
        ("CTL_OBSERVER", 4.0),
        ("CTL_REGULATOR", 3.0),
        ("CTL_HALL", 0.5),
        ("CTL_AE", 1.0),
        ("MOT_KV", 400.0),
    ],
)
def test_a_refused_value_is_answered_with_the_one_in_force(esc, name, value):
    before = esc.read_param(name).param_value
    mark = esc.mark()
    assert esc.set_param(name, value) == before
    reason = esc.wait("STATUSTEXT", lambda m: name in m.text, mark)
    assert reason is not None, "no reason given"
    assert esc.read_param(name).param_value == before


@pytest.mark.parametrize(
    "name, values",
    [
        ("CTL_MODE", [0, 1, 2]),
        ("CTL_OBSERVER", [0, 1, 2, 3]),
        ("CTL_REGULATOR", [0, 1, 2]),
        ("CTL_OBS_CURE", [0, 1]),
        ("CTL_ADAPT_L", [0, 1]),
        ("CTL_SPEED", [0, 1, 2]),
        ("CTL_FLUX_FORM", [0, 1, 2, 3]),
        ("CTL_HALL", [0, 1]),
        ("CTL_POS_N", [1, 2, 3, 4]),
        ("CTL_AE", [0.0, 0.9]),
        ("CTL_FF_A", [0.0, 8.4]),
        ("INP_3D", [0, 1]),
        ("PWM_DEADTIME_NS", [0, 500]),
        ("LIM_BUS_V_MAX", [60]),
        ("CTL_RPM_MIN", [100]),
    ],
)
def test_every_choice_of_the_control_can_be_set_at_rest(esc, name, values):
    for value in values:
        assert esc.set_param(name, value) == pytest.approx(value)


def test_six_step_needs_a_pwm_that_sees_its_crossings(start):
    with start("--param", "PWM_FREQ_HZ=40000").connect() as esc:
        assert esc.set_param("CTL_DRIVE", 1.0) == 1.0
        time.sleep(1.0)
        assert not unfit(esc)
    with start().connect() as esc:
        assert esc.set_param("CTL_DRIVE", 1.0) == 1.0
        esc.wait("STATUSTEXT", lambda m: m.text.startswith("Motor off: PWM_FREQ_HZ 0.000 too few "))
        assert esc.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1) == dialect.MAV_RESULT_DENIED


def unfit(esc, mark: int = 0) -> list[str]:
    """Returns why the motor is off, as told since the mark."""
    told = [m.text for m in esc.since(mark, "STATUSTEXT")]
    return [text for text in told if text.startswith("Motor off: ")]


@pytest.mark.parametrize("reverse", [False, True])
def test_another_motor_s_parameters_can_be_set_in_any_order(start, tmp_path, reverse):
    """From a bench at 24 V to one of 10 V and 60 kHz, which only a restart brings; a client does that in its own order."""
    with start("--bench", "whoop").connect() as esc:
        wanted = esc.params()
    storage = tmp_path / "flash.bin"
    emulator = start(storage=storage)
    with emulator.connect() as esc, emulator.throttle():
        esc.wait_armed()
        mark = esc.mark()
        for name in sorted(wanted, reverse=reverse):
            if name not in ("MOT_KV", "MOT_IDENTIFY"):
                assert esc.set_param(name, wanted[name]) == wanted[name], name
        assert esc.params() == pytest.approx(wanted)
        esc.next("HEARTBEAT")
        told = unfit(esc, mark)
        assert len(told) <= 1, told
    with emulator.connect() as esc:
        assert esc.command(dialect.MAV_CMD_PREFLIGHT_STORAGE, 1) == dialect.MAV_RESULT_ACCEPTED
    emulator.kill()
    emulator = start("--bench", "whoop", storage=storage)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        assert esc.params() == pytest.approx(wanted)
        esc.wait_armed()
        throttle.value = 500
        esc.wait_rpm(3000, 60000)
        assert not unfit(esc)


def test_what_makes_no_drive_is_stored_and_found_by_a_restart_with_the_motor_off(start, tmp_path):
    storage = tmp_path / "flash.bin"
    why = "Motor off: CTL_BW_CUR_HZ 2000.000 above a "
    emulator = start(storage=storage)
    with emulator.connect() as esc:
        assert esc.set_param("CTL_BW_CUR_HZ", 2000.0) == 2000.0
        assert esc.set_param("MOT_POLE_PAIRS", 11.0) == 11.0
        assert esc.wait("STATUSTEXT", lambda m: m.text.startswith(why))
        assert esc.command(dialect.MAV_CMD_PREFLIGHT_STORAGE, 1) == dialect.MAV_RESULT_ACCEPTED
    emulator.kill()
    emulator = start(storage=storage)
    with emulator.connect() as esc, emulator.throttle() as throttle:
        assert esc.read_param("CTL_BW_CUR_HZ").param_value == 2000.0
        assert esc.read_param("MOT_POLE_PAIRS").param_value == 11.0
        mark = esc.mark()
        assert esc.command(dialect.MAV_CMD_COMPONENT_ARM_DISARM, 1) == dialect.MAV_RESULT_DENIED
        assert esc.wait("STATUSTEXT", lambda m: m.text.startswith(why), mark)
        assert not esc.armed()
        mark = esc.mark()
        throttle.value = 500
        assert esc.wait("STATUSTEXT", lambda m: m.text.startswith(why), mark)
        throttle.value = 0
        assert esc.set_param("CTL_BW_CUR_HZ", 0.0) == 0.0
        esc.wait_armed()


def test_a_value_is_kept_as_the_float_that_was_sent(esc):
    sent = 30.600000381469727 * 1.25  # No f32 has this value.
    kept = esc.set_param("MOT_L_UH", sent)
    assert abs(kept - sent) < 1e-5 and kept == esc.read_param("MOT_L_UH").param_value


def test_other_targets_are_left_to_others(esc):
    mark = esc.mark()
    esc.codec.param_request_list_send(9, 1)
    esc.codec.param_request_read_send(1, 77, b"MOT_STOP", -1)
    esc.codec.param_set_send(9, 9, b"MOT_STOP", 0.0, dialect.MAV_PARAM_TYPE_REAL32)
    assert esc.read_param("MOT_STOP").param_value == 1.0
    assert len(esc.since(mark, "PARAM_VALUE")) == 1
    esc.system, esc.component = 0, 0
    assert len(esc.params()) >= len(FIXED_NAMES)
