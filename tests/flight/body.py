"""A quadrotor of 0.5 kg: a rigid body under four propellers, over ground, in wind.

The body's axes are forward, left, up; the earth's are north, west, up. Units are SI. Propellers are numbered as in
Betaflight: rear right, front right, rear left, front left; the first and the last turn clockwise.
"""

import math

GRAVITY = 9.80665
MASS = 0.5
# Estimates: four motors of 35 g, 110 mm from the middle, and a pack along it.
INERTIA = (1.3e-3, 1.5e-3, 2.6e-3)
# A frame with 220 mm between opposite motors. The pack sits slightly off its middle: the centre of mass is 1 mm behind
# it and 1 mm to the left.
ARM = 0.078
BEHIND, LEFT = 0.001, 0.001
PLACES = tuple((x + BEHIND, y - LEFT) for x, y in ((-ARM, -ARM), (ARM, -ARM), (-ARM, ARM), (ARM, ARM)))
TURNS = (-1, 1, 1, -1)
"""Direction of each propeller about the body's upward axis."""

# The propeller of the bench `quad-5-inch`, 0.127 m: its drag is the bench's. Its thrust coefficient is 0.115, an
# estimate for 5x4.5: 0.115/(2 pi)^2 * 1.225 * 0.127^4.
DRAG = 1.3e-8
THRUST = 9.28e-7
ROTOR_INERTIA = 2.5e-6 + 3.8e-6
# The axial air speed at which all thrust is lost is 0.127 m per turn: an advance ratio of 1, near the pitch of 4.5
# inches. The drag falls to some 0.4 there.
PITCH = 0.127 / math.tau
DRAG_LOST = 0.6
# Blade flapping: thrust leans back with air from the front. An estimate for a small rotor.
LEAN = 1.0e-2
# Frontal drag of the frame, half of the density times its area, and its height above the middle.
FRAME = 0.5 * 1.225 * 0.012
FRAME_Z = 0.03

FEET_Z = -0.04
FOOT_STIFF, FOOT_DAMP, FOOT_GRIP = 2500.0, 8.0, 0.7
INNER_STEPS = 2


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def flipped(vector) -> list[float]:
    """Converts axes with left and up to those with right and down, of the body or of the earth, and back."""
    return [vector[0], -vector[1], -vector[2]]


class Body:
    """Stands on the ground, facing north, until its propellers lift it."""

    STANDS = -FEET_Z - MASS * GRAVITY / (4 * FOOT_STIFF)
    """Height of its middle then."""

    def __init__(self):
        self.place = [0.0, 0.0, self.STANDS]
        self.speed = [0.0, 0.0, 0.0]
        self.attitude = (1.0, 0.0, 0.0, 0.0)
        self.rates = [0.0, 0.0, 0.0]
        self.felt = (0.0, 0.0, GRAVITY)
        """Specific force, as an accelerometer feels it, in the body's axes."""
        self.last_turns = (0.0, 0.0, 0.0, 0.0)

    def advance(self, seconds: float, rotors, wind) -> None:
        """Advances with the rotors at these speeds in rad/s and the wind in the earth's axes.

        A rotor that the wind turns backwards, at a negative speed, brakes the fall a little: that is left out.
        """
        dt = seconds / INNER_STEPS
        growth = [(now - before) / seconds for now, before in zip(rotors, self.last_turns)]
        for inner in range(1, INNER_STEPS + 1):
            share = inner / INNER_STEPS
            turns = [before + (now - before) * share for now, before in zip(rotors, self.last_turns)]
            self._step(dt, turns, growth, wind)
        self.last_turns = tuple(rotors)

    def air(self, wind) -> tuple:
        """Returns the air speed against the body, in its axes."""
        return self.to_body([w - v for w, v in zip(wind, self.speed)])

    def inflow(self, wind) -> list:
        """Returns the air speed through each propeller, m/s, positive from above."""
        down = -self.air(wind)[2]
        p, q, _ = self.rates
        return [down + p * y - q * x for x, y in PLACES]

    def _step(self, dt, turns, growth, wind) -> None:
        air = self.air(wind)
        force = [FRAME * math.hypot(*air) * a for a in air]
        torque = [-FRAME_Z * force[1], FRAME_Z * force[0], 0.0]
        spin = 0.0
        for (x, y), way, turn, rate, through in zip(PLACES, TURNS, turns, growth, self.inflow(wind)):
            advance = min(max(through / (PITCH * turn), -0.5), 1.0) if turn > 100.0 else 0.0
            lift = THRUST * max(turn, 0.0) ** 2 * (1.0 - advance)
            lean = LEAN * lift
            force = [force[0] + lean * air[0], force[1] + lean * air[1], force[2] + lift]
            drag = DRAG * turn * abs(turn) * (1.0 - DRAG_LOST * max(advance, 0.0))
            torque = [torque[0] + y * lift, torque[1] - x * lift, torque[2] - way * (drag + ROTOR_INERTIA * rate)]
            spin += way * ROTOR_INERTIA * turn
        for at, push in self._ground():
            force = [f + p for f, p in zip(force, push)]
            torque = [t + m for t, m in zip(torque, cross(at, push))]
        self.felt = tuple(f / MASS for f in force)
        pull = self.to_earth(self.felt)
        self.speed = [v + dt * a for v, a in zip(self.speed, (pull[0], pull[1], pull[2] - GRAVITY))]
        self.place = [s + dt * v for s, v in zip(self.place, self.speed)]
        momentum = [i * w for i, w in zip(INERTIA, self.rates)]
        momentum[2] += spin
        turning = cross(self.rates, momentum)
        self.rates = [w + dt * (t - c) / i for w, t, c, i in zip(self.rates, torque, turning, INERTIA)]
        self._turn(dt)

    def _ground(self):
        """Yields each foot that touches, with the force on it, in the body's axes."""
        if self.place[2] > 3 * ARM:
            return
        for x, y in PLACES:
            at = (x, y, FEET_Z)
            above = self.place[2] + self.to_earth(at)[2]
            if above >= 0.0:
                continue
            moves = self.to_earth([v + w for v, w in zip(self.to_body(self.speed), cross(self.rates, at))])
            up = max(0.0, -FOOT_STIFF * above - FOOT_DAMP * moves[2])
            grip = -FOOT_GRIP * up / (math.hypot(moves[0], moves[1]) + 0.05)
            yield at, self.to_body((grip * moves[0], grip * moves[1], up))

    def _turn(self, dt) -> None:
        """Turns the attitude by the rates, exactly if they are constant."""
        rate = math.hypot(*self.rates)
        if rate > 1e-12:
            half = 0.5 * rate * dt
            s = math.sin(half) / rate
            w, x, y, z = self.attitude
            c, i, j, k = math.cos(half), s * self.rates[0], s * self.rates[1], s * self.rates[2]
            turned = (
                w * c - x * i - y * j - z * k,
                w * i + x * c + y * k - z * j,
                w * j - x * k + y * c + z * i,
                w * k + x * j - y * i + z * c,
            )
            length = math.hypot(*turned)
            self.attitude = tuple(q / length for q in turned)

    def to_earth(self, v):
        w, x, y, z = self.attitude
        a, b, c = v
        # v + 2 w (q x v) + 2 q x (q x v)
        i, j, k = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
        return (a + w * i + y * k - z * j, b + w * j + z * i - x * k, c + w * k + x * j - y * i)

    def to_body(self, v):
        w, x, y, z = self.attitude
        a, b, c = v
        i, j, k = 2 * (z * b - y * c), 2 * (x * c - z * a), 2 * (y * a - x * b)
        return (a + w * i - y * k + z * j, b + w * j - z * i + x * k, c + w * k - x * j + y * i)

    @property
    def roll_pitch_deg(self) -> tuple[float, float]:
        """Right side down, nose up, as a pilot counts them."""
        up = self.to_body((0.0, 0.0, 1.0))
        return math.degrees(math.atan2(up[1], up[2])), math.degrees(math.atan2(up[0], math.hypot(up[1], up[2])))

    @property
    def tilt_deg(self) -> float:
        """Angle of the body's axis from upright."""
        return math.degrees(math.acos(max(-1.0, min(1.0, self.to_earth((0.0, 0.0, 1.0))[2]))))
