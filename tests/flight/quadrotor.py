"""The body and its four ESCs, which turn its propellers."""

import math

from body import DRAG_LOST, PITCH, Body

RPM = 30.0 / math.pi
CALM = (0.0, 0.0, 0.0)
UNHURT = (0.0, 0.0, 0.0, 0.0)


class Quadrotor:
    """Advances in steps, within which the air at each propeller stays as at their start."""

    SUPPLY_V, SUPPLY_OHM = 16.2, 0.016
    """The pack: four cells, nearly full."""

    def __init__(self, escs):
        self.body = Body()
        self.escs = escs

    def advance(self, ns: int, frames, wind=CALM, struck=UNHURT, supply_v: float = SUPPLY_V) -> None:
        """Advances with frames as `Escs.advance` takes them, the wind in the earth's axes in m/s, and torques that
        strike the propellers, in Nm."""
        inflow = self.body.inflow(wind)
        around = [(torque, air_rpm(turn, air)) for torque, turn, air in zip(struck, self.rotors, inflow)]
        self.escs.surround(supply_v, self.SUPPLY_OHM, around)
        self.escs.advance(ns, frames)
        self.body.advance(ns * 1e-9, self.rotors, wind)

    @property
    def rotors(self) -> list[float]:
        """How fast the propellers turn, rad/s. Only the body knows which way each one turns."""
        return [abs(esc.rpm) / RPM for esc in self.escs.all]


def air_rpm(turn: float, through: float) -> float:
    """Returns the emulator's air, rpm: the speed at which it would turn the propeller, which turns at `turn` rad/s.

    The emulator's drag goes by the square of what is left of the speed; the body's falls with the inflow.
    """
    if turn < 100.0 or through <= 0.0:
        return 0.0
    left = 1.0 - DRAG_LOST * min(through / (PITCH * turn), 1.0)
    return RPM * turn * (1.0 - math.sqrt(left))


def value_of(us: float) -> int:
    """Converts a pulse width in us to the value of a DShot frame: motor stop, or 48 to 2047."""
    return 0 if us <= 1001.0 else min(2047, max(48, round(47 + 2 * (us - 1000))))
