"""An ESC out of the bag, played by `out_of_the_bag.py`, with motors of the usual sizes and of any."""

import random

from motors import motor_of
from out_of_the_bag import AT_REST, MOST_CURRENT, drawn, opened

MOTORS = 150
ANY_SIZE = range(250, 300)
"""A tenth of the campaign's motors. In some of their windings the supply drives the current to its limit within a quarter
of a period."""


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


def test_motors_of_any_size_turn_within_their_current_or_are_told_why(tmp_path):
    outcomes = {number: drawn(tmp_path, number) for number in ANY_SIZE}
    assert {number: outcome for number, outcome in outcomes.items() if not outcome.holds()} == {}
    at_rest = {number: outcome for number, outcome in outcomes.items() if not outcome.turns()}
    assert len(at_rest) <= AT_REST * len(ANY_SIZE), at_rest
