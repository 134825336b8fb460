"""Slams, played by `slams.py`: on the library's benches, and on random motors."""

import random

import pytest

from slams import DEAD_TIMES_NS, MODES, PLANTS, SPEED, VOLTAGE, drawn, slammed

LIBRARY = ["bosso", "quad-3-inch", "quad-5-inch", "quad-7-inch", "quad-10-inch", "cinelifter", "lift-28-inch"]


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("mode", [SPEED, VOLTAGE])
@pytest.mark.parametrize("bench", LIBRARY)
def test_a_bench_of_the_library_keeps_its_rotor_through_slams(tmp_path, bench, mode, plant):
    draw = random.Random(f"{bench} {mode} {plant}")
    params = {"CTL_MODE": mode, "PWM_DEADTIME_NS": draw.choice(DEAD_TIMES_NS)}
    tables = {"bench": {"base": bench, "plant": plant}, "params": params}
    outcome = slammed(tmp_path, draw, tables, steps=150)
    assert outcome.holds(), outcome


@pytest.mark.parametrize("mode", MODES)
def test_random_motors_hold_through_slams(tmp_path, mode):
    # The plants alternate: `slams.py` plays both, and more.
    outcomes = {number: drawn(tmp_path, number, mode, PLANTS[number % 2], steps=60) for number in range(40)}
    assert {number: outcome for number, outcome in outcomes.items() if not outcome.holds()} == {}
