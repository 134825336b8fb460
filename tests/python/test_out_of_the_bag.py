"""An ESC out of the bag, played by `out_of_the_bag.py`, with motors of the usual sizes."""

import random

from motors import motor_of
from out_of_the_bag import AT_REST, MOST_CURRENT, opened

MOTORS = 150


def test_any_motor_turns_the_right_way_within_3_s_of_the_throttle(tmp_path):
    """At 30 % throttle; the phase current stays within a fifth above LIM_PHASE_A."""
    outcomes = {}
    for number in range(MOTORS):
        draw = random.Random(f"bag {number}")
        motor = motor_of(draw)
        outcomes[number] = opened(tmp_path, motor, draw.random() < 0.5)
    assert {number: outcome for number, outcome in outcomes.items() if outcome.current >= MOST_CURRENT} == {}
    suspected = {number: outcome for number, outcome in outcomes.items() if outcome.is_fast() and outcome.told}
    assert suspected == {}, "nothing is wrong with them"
    at_rest = {number: outcome for number, outcome in outcomes.items() if not outcome.turns()}
    assert len(at_rest) <= AT_REST * MOTORS, at_rest
