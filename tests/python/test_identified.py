"""Identified motors, as `identified.py` draws them, over the whole range."""

import random

from identified import identified
from motors import any_motor
from out_of_the_bag import FACTORY, limits

MOTORS = 20


def test_random_motors_are_found_or_refused_with_a_reason(tmp_path):
    found = {}
    for number in range(MOTORS):
        motor = any_motor(random.Random(f"bag {number}"))
        known = {name: motor["params"][name] for name in ("MOT_POLE_PAIRS", "CTL_RPM_MAX")}
        found[number], _ = identified(tmp_path, motor, FACTORY | limits(motor) | known)
    assert {number: one for number, one in found.items() if not one.is_sound()} == {}
    off = {number: one for number, one in found.items() if not one.is_near()}
    # Of many it is to be one in twenty: of twenty two may be.
    assert len(off) <= 2, off
