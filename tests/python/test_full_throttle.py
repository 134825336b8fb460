"""Full throttle, played by `full_throttle.py`, on the library's propellers and on random motors."""

import pytest

from full_throttle import LEAST, LEAST_WRONG, MODES, drawn, of_library
from thrust import PROPELLERS


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("name", PROPELLERS)
def test_a_bench_turns_as_fast_as_its_supply_and_limits_allow_through_slams(tmp_path, name, mode):
    outcome = of_library(tmp_path, name, mode, wrong=0)
    assert outcome.holds(LEAST), outcome


@pytest.mark.parametrize("name", PROPELLERS[::2])
def test_a_motor_that_is_stated_wrong_does_nearly(tmp_path, name):
    outcome = of_library(tmp_path, name, "voltage", wrong=1)
    assert outcome.holds(LEAST_WRONG), outcome


def test_random_motors_turn_as_fast_as_they_can(tmp_path):
    outcomes = {number: drawn(tmp_path, number, list(MODES)[number % 2]) for number in range(6)}
    assert {number: outcome for number, outcome in outcomes.items() if not outcome.holds(LEAST)} == {}
