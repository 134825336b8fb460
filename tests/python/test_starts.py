"""Starts, played by `starts.py`: on the library's benches, from angles all around, and on random motors."""

import random

import pytest

from out_of_the_bag import FACTORY
from slams import PLANTS, VOLTAGE
from starts import DRIVES, LARGE_LIMIT_S, LATE, LIMIT_S, drawn, started

LIBRARY = ["whoop", "quad-3-inch", "quad-5-inch", "quad-7-inch", "quad-10-inch", "quad-15-inch", "bosso", "cinelifter"]
LARGE = ["lift-28-inch"]
ANGLES = 5
MOTORS = 40


@pytest.mark.parametrize("drive", ["known", "unknown"])
@pytest.mark.parametrize("bench", LIBRARY + LARGE)
def test_a_bench_of_the_library_turns_at_idle_in_time(tmp_path, bench, drive):
    draw = random.Random(f"{bench} {drive}")
    params = {"STA_MODE": 0, "CTL_MODE": VOLTAGE} if drive == "known" else FACTORY | {"STA_MODE": 0}
    limit_s = LARGE_LIMIT_S if bench in LARGE else LIMIT_S
    for n in range(ANGLES):
        at = {"initial_angle_deg": 360 * (n + draw.random()) / ANGLES, "plant": PLANTS[n % 2]}
        outcome = started(tmp_path, {"bench": {"base": bench} | at, "params": params}, limit_s)
        assert outcome.is_in_time(), (at, outcome)


@pytest.mark.parametrize("drive", DRIVES)
def test_random_motors_turn_at_idle_in_time(tmp_path, drive):
    outcomes = {number: drawn(tmp_path, number, drive) for number in range(MOTORS)}
    late = {number: outcome for number, outcome in outcomes.items() if not outcome.is_in_time()}
    # Three standard deviations above what the campaign of 500 allows.
    assert len(late) <= LATE * MOTORS + 3 * (LATE * MOTORS) ** 0.5, late
