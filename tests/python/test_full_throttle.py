"""Full throttle, played by `full_throttle.py`, on the library's propellers and on random motors."""

import pytest

from full_throttle import LEAST, LEAST_SIX_STEP, LEAST_WRONG, MODES, SIX_STEP_REACHES, drawn, in_six_step, of_library
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


@pytest.mark.parametrize("name", SIX_STEP_REACHES)
def test_six_step_does_nearly_without_knowing_the_motor(tmp_path, name):
    outcome = in_six_step(tmp_path, name)
    assert outcome.holds(LEAST_SIX_STEP), outcome


@pytest.mark.parametrize("name", ["whoop", "quad-3-inch", "quad-5-inch"])
def test_six_step_holds_the_speed_where_its_samples_end(tmp_path, name):
    outcome = in_six_step(tmp_path, name)
    # The best is the fastest that they follow.
    assert outcome.holds(LEAST) and outcome.share < 1.02, outcome


def test_random_motors_turn_as_fast_as_they_can(tmp_path):
    outcomes = {number: drawn(tmp_path, number, list(MODES)[number % 2]) for number in range(6)}
    assert {number: outcome for number, outcome in outcomes.items() if not outcome.holds(LEAST)} == {}
