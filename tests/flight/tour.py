"""A tour of what a quadrotor meets: rolls, a gust, a weak pack, a propeller strike, a broken wire."""

import math

from body import Body
from judge import Verdict, between, level
from plan import Plan
from quadrotor import CALM, PACK


class Tour(Plan):
    HOVER = (5.0, 6.0)
    RIGHT_S, LEFT_S, LEVEL_S = 6.0, 6.8, 7.6
    GUST = (9.0, 10.0)
    SAG = (10.5, 13.0)
    STRIKE_S = 12.0
    SILENT = (13.5, 13.55)
    LAST_HOVER = (14.5, 15.5)
    LAND_S = 15.5
    STEADY = (HOVER, LAST_HOVER)
    FLIES = (HOVER[0], LAND_S)

    ROLL_DEG, FULL_ROLL_DEG = 30.0, 60.0
    """What it rolls to, and what a stick at its end stop asks for."""
    SINK_M_S = 0.5
    SAG_V = 13.6
    STRUCK, STRIKE_NM, STRIKE_FOR_S = 1, -0.2, 0.02
    SILENT_ESC = 2

    def __init__(self):
        super().__init__()
        self.landed = False

    def roll(self, now_s: float) -> float:
        right, left, level = self.RIGHT_S, self.LEFT_S, self.LEVEL_S
        return self.ROLL_DEG / self.FULL_ROLL_DEG * ((right <= now_s < left) - (left <= now_s < level))

    def throttle(self, now_s: float, height_m: float, climb_m_s: float) -> float:
        if now_s < self.TAKE_OFF_S or self.landed:
            return 0.0
        self.landed = now_s > self.LAND_S and height_m < Body.STANDS + 0.01
        return self.held(height_m, climb_m_s, *self.wanted(now_s))

    def wanted(self, now_s: float) -> tuple[float, float]:
        """Returns the desired height, and how fast it changes."""
        down = self.HEIGHT_M - self.SINK_M_S * (now_s - self.LAND_S)
        return self.risen(now_s) if down > self.HEIGHT_M else (down, -self.SINK_M_S)

    def wind(self, now_s: float) -> tuple[float, float, float]:
        """A gust of 12 m/s from ahead and the left, which also blows up."""
        begin, end = self.GUST
        if not begin <= now_s < end:
            return CALM
        swell = 0.5 * (1.0 - math.cos(math.tau * (now_s - begin) / (end - begin)))
        return (-8.0 * swell, -9.0 * swell, 3.0 * swell)

    def pack(self, now_s: float) -> tuple[float, float]:
        """A cell fails, over a second."""
        begin, end = self.SAG
        full_v, ohm = PACK
        share = min(max((now_s - begin) / 1.0, 0.0), 1.0) if now_s < end else 0.0
        return full_v + (self.SAG_V - full_v) * share, ohm

    def struck(self, now_s: float) -> list[float]:
        """A twig."""
        hits = self.STRIKE_S <= now_s < self.STRIKE_S + self.STRIKE_FOR_S
        return [self.STRIKE_NM * (hits and index == self.STRUCK) for index in range(4)]

    def silent(self, now_s: float, esc: int) -> bool:
        return esc == self.SILENT_ESC and self.SILENT[0] <= now_s < self.SILENT[1]

    def spans(self) -> list[tuple[str, float, float]]:
        return [
            ("climb", self.TAKE_OFF_S, self.HOVER[0] - 1.0),
            ("hover", self.HOVER[0] - 1.0, self.HOVER[1]),
            ("roll", self.RIGHT_S, self.LEVEL_S),
            ("gust", *self.GUST),
            ("weak pack", *self.SAG),
            ("hover", *self.LAST_HOVER),
            ("descent", self.LAND_S, self.LAND_S + (self.HEIGHT_M - Body.STANDS) / self.SINK_M_S),
        ]

    def judge(self, verdict: Verdict, rows: list[dict]) -> None:
        verdict.at_most("tilt", max(row["tilt"] for row in rows), 60.0, "°")
        for name, window in [("first", self.HOVER), ("last", self.LAST_HOVER)]:
            hovers = between(rows, window)
            level(verdict, f"{name} hover", hovers)
            missed = max(abs(row["height"] - self.HEIGHT_M) for row in hovers)
            verdict.at_most(f"height missed in the {name} hover", missed, 0.15, " m")
        right, left, back = self.RIGHT_S, self.LEFT_S, self.LEVEL_S
        step(verdict, "roll to the right", between(rows, (right, left)), 0.0, self.ROLL_DEG)
        step(verdict, "roll to the left", between(rows, (left, back)), self.ROLL_DEG, -self.ROLL_DEG)
        step(verdict, "roll back", between(rows, (back, self.GUST[0])), -self.ROLL_DEG, 0.0)
        last = rows[-1]
        verdict.at_most("height after landing", abs(last["height"] - Body.STANDS), 0.005, " m")
        verdict.at_most("fastest at rest", max(abs(rpm) for rpm in last["rpm"]), 0.0, " rpm")


def step(verdict: Verdict, name: str, rows: list[dict], before: float, after: float) -> None:
    rolls = [row["roll"] for row in rows]
    way = after - before
    verdict.at_most(f"end of the {name}", max(abs(roll - after) for roll in rolls[-100:]), 2.0, "°")
    verdict.at_most(f"overshoot of the {name}", 100 * max((roll - after) / way for roll in rolls), 15.0, " %")
