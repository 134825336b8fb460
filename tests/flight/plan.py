"""What the pilot flies, and what happens to him.

He sees his height, and flies it by a simple loop on the throttle stick.
"""

import math

from body import Body
from quadrotor import Quadrotor

ARM_S, TAKE_OFF_S = 1.9, 2.3
HOVER = (5.0, 6.0)
RIGHT_S, LEFT_S, LEVEL_S = 6.0, 6.8, 7.6
GUST = (9.0, 10.0)
SAG = (10.5, 13.0)
STRIKE_S = 12.0
SILENT = (13.5, 13.55)
LAST_HOVER = (14.5, 15.5)
LAND_S = 15.5
DISARM_S = 19.0
END_S = 20.0

HEIGHT_M, ROLL_DEG = 1.5, 30.0
CLIMB_M_S, SINK_M_S = 1.0, 0.5

SAG_V = 13.6
STRUCK, STRIKE_NM, STRIKE_FOR_S = 1, -0.2, 0.02
SILENT_ESC = 2

LOW, HIGH = 1000, 2000
FULL_ROLL_DEG = 60.0
"""What a stick at its end stop asks for."""


class Pilot:
    """Moves the sticks a hundred times a second."""

    EVERY_NS = 10_000_000
    STIFF, DAMP, LEARN = 0.35, 0.18, 0.30
    """Share of the stick's travel per metre, per metre per second, and per metre in a second."""
    FIRST = 0.3

    def __init__(self):
        self.learned = self.FIRST
        self.landed = False

    def sticks(self, now_s: float, height_m: float, climb_m_s: float) -> list[int]:
        """Returns the channels in us: roll, pitch, throttle, yaw, the switches for arming and for angle mode."""
        roll = ROLL_DEG / FULL_ROLL_DEG * ((RIGHT_S <= now_s < LEFT_S) - (LEFT_S <= now_s < LEVEL_S))
        throttle = self._throttle(now_s, height_m, climb_m_s)
        armed = HIGH if ARM_S <= now_s < DISARM_S else LOW
        return [1500 + round(500 * roll), 1500, LOW + round(1000 * throttle), 1500, armed, HIGH, *[LOW] * 10]

    def _throttle(self, now_s: float, height_m: float, climb_m_s: float) -> float:
        if now_s < TAKE_OFF_S or self.landed:
            return 0.0
        self.landed = now_s > LAND_S and height_m < Body.STANDS + 0.01
        wanted, rises = self.wanted(now_s)
        miss = wanted - height_m
        self.learned += self.LEARN * miss * self.EVERY_NS * 1e-9
        return min(0.9, max(0.06, self.learned + self.STIFF * miss + self.DAMP * (rises - climb_m_s)))

    @staticmethod
    def wanted(now_s: float) -> tuple[float, float]:
        """Returns the desired height, and how fast it changes."""
        up = Body.STANDS + CLIMB_M_S * (now_s - TAKE_OFF_S)
        down = HEIGHT_M - SINK_M_S * (now_s - LAND_S)
        if up < HEIGHT_M:
            return up, CLIMB_M_S
        return (HEIGHT_M, 0.0) if down > HEIGHT_M else (down, -SINK_M_S)


def wind(now_s: float) -> tuple[float, float, float]:
    """North, west and up, m/s: a gust of 12 m/s from ahead and the left, which also blows up."""
    begin, end = GUST
    if not begin <= now_s < end:
        return (0.0, 0.0, 0.0)
    swell = 0.5 * (1.0 - math.cos(math.tau * (now_s - begin) / (end - begin)))
    return (-8.0 * swell, -9.0 * swell, 3.0 * swell)


def supply_v(now_s: float) -> float:
    """The pack's voltage without load: a cell fails, over a second."""
    begin, end = SAG
    share = min(max((now_s - begin) / 1.0, 0.0), 1.0) if now_s < end else 0.0
    return Quadrotor.SUPPLY_V + (SAG_V - Quadrotor.SUPPLY_V) * share


def struck(now_s: float) -> list[float]:
    """Returns the torque that a twig puts on each shaft, Nm."""
    hits = STRIKE_S <= now_s < STRIKE_S + STRIKE_FOR_S
    return [STRIKE_NM * (hits and index == STRUCK) for index in range(4)]


def silent(now_s: float, esc: int) -> bool:
    """Returns whether the wire to this ESC is broken."""
    return esc == SILENT_ESC and SILENT[0] <= now_s < SILENT[1]


def event(now_s: float) -> str:
    """Returns what is going on at this time, for a picture."""
    spans = [
        ("climb", TAKE_OFF_S, HOVER[0] - 1.0),
        ("hover", HOVER[0] - 1.0, HOVER[1]),
        ("roll", RIGHT_S, LEVEL_S),
        ("gust", *GUST),
        ("weak pack", *SAG),
        ("hover", *LAST_HOVER),
        ("descent", LAND_S, LAND_S + (HEIGHT_M - Body.STANDS) / SINK_M_S),
    ]
    return next((name for name, begin, end in spans if begin <= now_s < end), "")


def breaks(now_s: float) -> bool:
    """Returns whether a propeller is struck, or a wire silent."""
    return any(struck(now_s)) or silent(now_s, SILENT_ESC)
