"""The body and its four ESCs, which turn its propellers."""

import math

from body import DRAG_LOST, PITCH, Body

RPM = 30.0 / math.pi
CALM = (0.0, 0.0, 0.0)
PACK = (16.2, 0.016)
"""Four cells, nearly full: voltage without load, and resistance in ohm."""
UNHURT = (0.0, 0.0, 0.0, 0.0)
MILL, MILL_FADES = 0.7, 500.0
"""Speed of a propeller in air from behind, over the one that the pitch gives: an estimate. It fades up to this forward
speed, rad/s, half of what hovers."""


class Quadrotor:
    """Advances in steps, within which the air at each propeller stays as at their start."""

    def __init__(self, escs):
        self.body = Body()
        self.escs = escs

    def advance(self, ns: int, frames, wind=CALM, struck=UNHURT, pack=PACK) -> None:
        """Advances with frames as `Escs.advance` takes them, the wind in the earth's axes in m/s, torques that strike
        the propellers, in Nm, and the pack's voltage and resistance."""
        inflow = self.body.inflow(wind)
        around = [(torque, air_rpm(turn, air)) for torque, turn, air in zip(struck, self.rotors, inflow)]
        self.escs.surround(*pack, around)
        self.escs.advance(ns, frames)
        self.body.advance(ns * 1e-9, self.rotors, wind)

    @property
    def rotors(self) -> list[float]:
        """How fast the propellers turn, rad/s; negative against their way, which only the body knows."""
        return [esc.rpm / RPM for esc in self.escs.all]


def air_rpm(turn: float, through: float) -> float:
    """Returns the emulator's air, rpm: the speed at which it would turn the propeller, which turns at `turn` rad/s.

    The emulator's drag goes by the square of what is left of the speed; the body's falls with the inflow. Air from below
    turns a propeller that stands, backwards; it matters less the faster that turns forwards.
    """
    if through <= 0.0:
        windmill = RPM * MILL * through / PITCH
        return windmill * min(1.0, max(0.0, 1.0 - turn / MILL_FADES))
    if turn < 100.0:
        return 0.0
    left = 1.0 - DRAG_LOST * min(through / (PITCH * turn), 1.0)
    return RPM * turn * (1.0 - math.sqrt(left))


def value_of(us: float) -> int:
    """Converts a pulse width in us to the value of a DShot frame: motor stop, or 48 to 2047."""
    return 0 if us <= 1001.0 else min(2047, max(48, round(47 + 2 * (us - 1000))))
