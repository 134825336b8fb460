"""An ESC out of the bag: of the motor it knows nothing, of the board's limits all."""

import random

from emulator import MOTOR
from motors import FROM_MOTOR, drawn_bench, flown, motor_of

MOTORS = 150
FACTORY = {**dict.fromkeys([*MOTOR, *FROM_MOTOR], 0), "CTL_DRIVE": 2}
OPENS_S, SHARE = 0.5, 0.3
END_S = OPENS_S + 3.0


def test_any_motor_turns_the_right_way_within_3_s_of_the_throttle(tmp_path):
    """At 30 % of throttle; the phase current stays within a fifth above LIM_PHASE_A."""
    at_rest, too_much = [], []
    for number in range(MOTORS):
        motor = motor_of(random.Random(f"bag {number}"))
        limits = {name: value for name, value in motor["params"].items() if name.startswith(("LIM_", "PWM_"))}
        tables = drawn_bench(motor)
        tables["bench"]["duration_s"] = END_S
        tables["params"] = FACTORY | limits
        windows = {"all": (0.0, END_S), "end": (END_S - 0.2, END_S)}
        faults, windows = flown(tmp_path, tables, [(0.0, 0.0), (OPENS_S, SHARE)], windows)
        # Half of what a share of the supply makes of a motor without its load's losses.
        if faults or windows["end"]["rpm_min"] < 0.5 * SHARE * motor["rpm"]:
            at_rest.append((number, faults))
        if windows["all"]["current_max_a"] > 1.2 * motor["params"]["LIM_PHASE_A"]:
            too_much.append(number)
    assert len(at_rest) <= 0.02 * MOTORS, at_rest
    assert too_much == []
