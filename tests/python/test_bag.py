"""Punches on motors of which nothing is told, played by `bag.py`."""

import pytest

from bag import drawn, of_library

LOST_BEFORE = [
    ("whoop", 24_000), ("whoop", 48_000), ("quad-3-inch", 24_000), ("quad-5-inch", 48_000), ("quad-5-inch", 60_000),
    ("quad-7-inch", 48_000), ("cinelifter", 24_000), ("cinelifter", 48_000), ("racer-6s", 24_000),
    ("racer-6s", 48_000), ("racer-6s", 60_000),
]  # fmt: skip
"""Benches that are faster than the samples follow, or nearly, with the PWM's frequency."""


@pytest.mark.parametrize(("name", "pwm_hz"), LOST_BEFORE)
def test_a_motor_keeps_its_rotor_through_full_throttle(tmp_path, name, pwm_hz):
    outcome = of_library(tmp_path, name, pwm_hz)
    assert outcome.holds(), outcome


def test_random_motors_do(tmp_path):
    outcomes = {number: drawn(tmp_path, number, 24_000) for number in (0, 1, 2, 4, 5)}
    assert {number: outcome for number, outcome in outcomes.items() if not outcome.holds()} == {}
