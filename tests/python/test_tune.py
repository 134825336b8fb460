"""Motors that nobody has tuned by hand start and follow the throttle with the settings derived from them."""

import random

import pytest

from motors import FROM_MOTOR, drawn_bench, flown, motor_of, tune


def flight(folder, number: int, plant: str) -> tuple[bool, bool]:
    """Opens the throttle to 30 % at 0.5 s, and to 90 % at 2.5 s.

    Returns whether a drawn motor turns in the end, without a fault, and whether it does so at the first attempt.
    """
    motor = motor_of(random.Random(number))
    followed = tune(motor["params"])
    assert followed.keys() == {*FROM_MOTOR, "PWM_FREQ_HZ"}
    tables = drawn_bench(motor)
    tables["bench"] |= {"duration_s": 3.5, "plant": plant}
    tables["params"] = motor["params"] | dict.fromkeys(followed, 0)
    throttle = [(0.0, 0.0), (0.5, 0.3), (2.5, 0.9)]
    windows = {"all": (0.0, 3.5), "slow": (2.2, 2.5), "end": (3.4, 3.5)}
    faults, windows = flown(folder, tables, throttle, windows)
    turns = faults == [] and windows["end"]["rpm_mean"] > followed["CTL_RPM_MIN"]
    # Speed mode: from CTL_RPM_MIN to CTL_RPM_MAX.
    wanted = followed["CTL_RPM_MIN"] + 0.3 * (motor["rpm"] - followed["CTL_RPM_MIN"])
    follows = windows["slow"]["rpm_mean"] == pytest.approx(wanted, rel=0.03)
    at_once = windows["all"]["starts"] == 1 and not windows["all"]["lock_lost"]
    return turns, turns and follows and at_once


# The switching plant's ripple is one more disturbance to the ramp's estimate.
@pytest.mark.parametrize(("plant", "motors", "again_share"), [("averaged", 120, 0.05), ("switching", 20, 0.2)])
def test_motors_that_nobody_tuned_start_and_follow_the_throttle(tmp_path, plant, motors, again_share):
    flights = {number: flight(tmp_path, number, plant) for number in range(motors)}
    assert [number for number, (turns, _) in flights.items() if not turns] == []
    again = [number for number, (_, at_once) in flights.items() if not at_once]
    assert len(again) <= again_share * motors, again
