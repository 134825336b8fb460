"""Slams, as `slams.py` plays them: of the library's benches, and of random motors."""

import random

import pytest

from slams import DEAD_TIMES_NS, PLANTS, SPEED, VOLTAGE, drawn, slammed

LIBRARY = ["bosso", "quad-3-inch", "quad-5-inch", "quad-7-inch", "quad-10-inch", "cinelifter", "lift-28-inch"]


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("mode", [SPEED, VOLTAGE])
@pytest.mark.parametrize("bench", LIBRARY)
def test_a_bench_of_the_library_keeps_its_rotor_through_slams(tmp_path, bench, mode, plant):
    draw = random.Random(f"{bench} {mode} {plant}")
    # Of a 3-inch motor's 60 kHz 750 ns are a twentieth: there the angle is known to 50 degrees.
    dead_times_ns = DEAD_TIMES_NS[:-1] if bench == "quad-3-inch" else DEAD_TIMES_NS
    params = {"CTL_MODE": mode, "PWM_DEADTIME_NS": draw.choice(dead_times_ns)}
    tables = {"bench": {"base": bench, "plant": plant}, "params": params}
    outcome = slammed(tmp_path, draw, tables, steps=150)
    assert outcome.holds(), outcome


@pytest.mark.parametrize("mode", ["speed", "voltage"])
def test_random_motors_turn_on_through_slams(tmp_path, mode):
    """Without a fault and without a start of their own; of what the angle's error reaches nothing is said."""
    outcomes = [(number, drawn(tmp_path, number, mode, "averaged", steps=50)) for number in range(40)]
    assert [case for case in outcomes if case[1].faults or case[1].starts] == []
