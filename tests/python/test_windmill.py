"""Throttle after a cut in the wind, played by `windmill.py`."""

import random

import pytest

from windmill import KNOWN, STOPS, WINDS, blown, half_rpm, market_motor, told

MOTORS = 5


@pytest.mark.parametrize("stop", STOPS)
def test_a_known_motor_comes_back_from_any_wind_within_half_a_second(tmp_path, stop):
    outcomes = {}
    for number in range(MOTORS):
        tables = told(market_motor(random.Random(f"windmill {number}")), KNOWN, STOPS[stop])
        rpm = half_rpm(tmp_path, tables)
        for wind in WINDS:
            outcomes[number, wind] = blown(tmp_path, tables, KNOWN, wind * rpm)
    assert {case: outcome for case, outcome in outcomes.items() if not outcome.holds()} == {}
