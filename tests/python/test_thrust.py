"""The shortest time for a climb, computed by `thrust.py`, on shafts whose time can be worked out by hand."""

import math

import pytest

from thrust import FIELD_ORIENTED, PROPELLERS, STEP_S, Punch, bench, least_s, punched

RPM_PER_RAD_S = 60 / math.tau


def shaft(volts: float) -> dict:
    """7 pole pairs with 1 mWb: 20 A gives 0.21 Nm, and 21 000 rad/s^2 with 1e-5 kg*m^2."""
    motor = {"R": 1e-3, "L": 1e-9, "flux": 1e-3, "pole_pairs": 7, "J": 0.6e-5}
    load = {"c2": 0.0, "J": 0.4e-5}
    return {"bench": {"motor": motor, "load": load, "bus": volts}, "params": {"LIM_PHASE_A": 20, "LIM_BUS_A": 200}}


def test_without_a_load_it_is_the_time_of_the_limit_s_torque():
    climb = Punch(100 * RPM_PER_RAD_S, 520 * RPM_PER_RAD_S, 60.0, None)
    assert least_s(shaft(60.0), climb) == pytest.approx(0.02, abs=2 * STEP_S)


def test_a_load_takes_its_part_of_the_torque():
    tables = shaft(60.0)
    # Half of it.
    tables["bench"]["load"]["torque_nm"] = 0.105
    climb = Punch(0.0, 210 * RPM_PER_RAD_S, 60.0, None)
    assert least_s(tables, climb) == pytest.approx(0.02, abs=2 * STEP_S)


def test_a_speed_that_the_supply_does_not_give_is_never_reached():
    # With 1 mWb, 5 V turns the shaft at 412 rad/s.
    tables = shaft(5.0)
    tables["bench"]["load"]["c2"] = 1e-7
    assert least_s(tables, Punch(0.0, 420 * RPM_PER_RAD_S, 5.0, None)) == math.inf
    assert math.isfinite(least_s(tables, Punch(0.0, 400 * RPM_PER_RAD_S, 5.0, None)))


# quad-3-inch and quad-10-inch take 1.2 times as long, since the back-EMF bounds the current at idle, and the helicopter 1.3
# times, with a speed loop of 3 Hz.
WITHIN = [name for name in PROPELLERS if name not in ("quad-3-inch", "quad-10-inch", "helicopter")]


@pytest.mark.parametrize("name", WITHIN)
def test_thrust_comes_in_little_more_than_the_least_time(tmp_path, name):
    punch = punched(tmp_path, name, FIELD_ORIENTED)
    assert punch.took_s is not None and punch.took_s < 1.15 * least_s(bench(name), punch)
