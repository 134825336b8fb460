"""An ESC out of the bag, as `out_of_the_bag.py` plays it."""

from out_of_the_bag import AT_REST, opened

MOTORS = 50


def test_any_motor_turns_the_right_way_within_3_s_of_the_throttle_or_is_said_not_to(tmp_path):
    outcomes = {number: opened(tmp_path, number) for number in range(MOTORS)}
    assert {number: outcome for number, outcome in outcomes.items() if not outcome.holds()} == {}
    at_rest = {number: outcome for number, outcome in outcomes.items() if not outcome.turns()}
    assert len(at_rest) <= AT_REST * MOTORS, at_rest
