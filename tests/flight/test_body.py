"""The rigid body alone: what follows from it by hand."""

import math

import pytest

from body import ARM, FRAME, GRAVITY, INERTIA, LEAN, LEFT, MASS, THRUST, TURNS, Body

STEP_S = 1e-3
CALM = (0.0, 0.0, 0.0)
HOVERS = math.sqrt(MASS * GRAVITY / (4 * THRUST))


def flown(seconds: float, rotors, height: float = 10.0) -> Body:
    """Flies a body in the air, with rotors already turning."""
    body = Body()
    body.place[2] = height
    body.last_turns = tuple(rotors)
    for _ in range(round(seconds / STEP_S)):
        body.advance(STEP_S, rotors, CALM)
    return body


def test_it_stands_where_it_is_put():
    body = Body()
    for _ in range(1000):
        body.advance(STEP_S, (0.0,) * 4, CALM)
    # The pack off its middle presses two of the feet a few um deeper.
    assert body.place == pytest.approx([0.0, 0.0, Body.STANDS], abs=2e-5)
    assert body.felt == pytest.approx((0.0, 0.0, GRAVITY), abs=5e-3)


def test_it_falls_freely_and_feels_nothing():
    body = flown(0.1, (0.0,) * 4)
    # Without air drag at first; an Euler step is half a step ahead.
    assert body.speed[2] == pytest.approx(-GRAVITY * 0.1, rel=2e-3)
    assert body.felt == pytest.approx((0.0, 0.0, 0.0), abs=0.02)


def test_the_bench_hovers_at_eleven_thousand():
    assert HOVERS * 30 / math.pi == pytest.approx(11_000, rel=0.01)
    body = flown(0.1, (HOVERS,) * 4)
    assert body.speed[2] == pytest.approx(0.0, abs=1e-3)


def test_more_thrust_on_the_left_rolls_right_as_the_inertia_has_it():
    faster = 1.02 * HOVERS
    body, even = flown(0.02, (HOVERS, HOVERS, faster, faster)), flown(0.02, (HOVERS,) * 4)
    torque = 2 * (ARM - LEFT) * THRUST * (faster**2 - HOVERS**2)
    assert body.rates[0] - even.rates[0] == pytest.approx(0.02 * torque / INERTIA[0], rel=0.02)
    assert body.roll_pitch_deg[0] > even.roll_pitch_deg[0]


def test_it_turns_against_faster_propellers():
    rotors = [HOVERS * (1.02 if way > 0 else 0.98) for way in TURNS]
    assert flown(0.1, rotors).rates[2] < -0.01


def test_climbing_takes_thrust_away():
    body = flown(0.0, (HOVERS,) * 4)
    body.speed[2] = 2.0
    body.advance(STEP_S, (HOVERS,) * 4, CALM)
    advance = 2.0 / (HOVERS * 0.127 / math.tau)
    assert body.felt[2] == pytest.approx(GRAVITY * (1 - advance), rel=0.01)


def test_wind_pushes_it_along():
    windy, calm = flown(0.0, (HOVERS,) * 4), flown(0.05, (HOVERS,) * 4)
    for _ in range(50):
        windy.advance(STEP_S, (HOVERS,) * 4, (0.0, 5.0, 0.0))
    force = FRAME * 5.0**2 + LEAN * MASS * GRAVITY * 5.0
    # It gives way a little, and begins to lean.
    assert windy.speed[1] - calm.speed[1] == pytest.approx(0.05 * force / MASS, rel=0.1)
    assert windy.speed[0] == pytest.approx(calm.speed[0], abs=1e-3)


def test_axes_turn_back_and_forth():
    body = flown(0.3, (HOVERS, 1.1 * HOVERS, HOVERS, 0.9 * HOVERS))
    assert body.tilt_deg > 5.0
    vector = (1.0, -2.0, 3.0)
    assert body.to_body(body.to_earth(vector)) == pytest.approx(vector)
