"""What a pilot feels: full throttle straight up, motors that stop in the fall, full throttle from a pack near its end."""

import math

from full_throttle import Plant, plant_of
from judge import Verdict, between, level
from plan import Pilot, Plan
from quadrotor import PACK
from thrust import bench

BENCH = "quad-5-inch"


class Slowing:
    """A height that comes to rest, from where and how fast a body moved."""

    SECONDS = 0.6

    def __init__(self, now_s: float, height_m: float, climb_m_s: float):
        self.from_s, self.from_m, self.from_m_s = now_s, height_m, climb_m_s

    def wanted(self, now_s: float) -> tuple[float, float]:
        left = math.exp((self.from_s - now_s) / self.SECONDS)
        return self.from_m + self.from_m_s * self.SECONDS * (1.0 - left), self.from_m_s * left


class Punch(Plan):
    HOVER = (4.0, 4.5)
    PUNCH = (4.5, 5.2)
    CUT = (6.6, 8.2)
    """The pilot disarms in the fall, and arms again."""
    CAUGHT_S = 8.3
    AGAIN = (10.5, 11.0)
    EMPTY_S = 11.0
    SAG = (11.5, 12.2)
    LAST = (16.0, 16.5)
    DISARM_S = END_S = 16.5
    STARTS = 2
    STEADY = (HOVER, AGAIN, LAST)
    FLIES = (HOVER[0], CUT[0])
    EMPTY = (13.2, 0.05)
    """3.3 V a cell, and the resistance of cells that are old and cold."""

    def __init__(self):
        super().__init__()
        self.slowing = None

    def is_armed(self, now_s: float) -> bool:
        begin, end = self.CUT
        return super().is_armed(now_s) and not begin <= now_s < end

    def throttle(self, now_s: float, height_m: float, climb_m_s: float) -> float:
        full = any(begin <= now_s < end for begin, end in (self.PUNCH, self.SAG))
        if full or now_s < self.TAKE_OFF_S or self.PUNCH[1] <= now_s < self.CAUGHT_S:
            self.slowing = None
            return float(full)
        if now_s < self.PUNCH[0]:
            return self.held(height_m, climb_m_s, *self.risen(now_s))
        if self.slowing is None:
            self.pilot = Pilot()
            self.slowing = Slowing(now_s, height_m, climb_m_s)
        return self.held(height_m, climb_m_s, *self.slowing.wanted(now_s))

    def pack(self, now_s: float) -> tuple[float, float]:
        return PACK if now_s < self.EMPTY_S else self.EMPTY

    def spans(self) -> list[tuple[str, float, float]]:
        return [
            ("punch", *self.PUNCH),
            ("disarmed", *self.CUT),
            ("sag", *self.SAG),
        ]

    def judge(self, verdict: Verdict, rows: list[dict]) -> None:
        verdict.at_most("tilt", max(row["tilt"] for row in rows), 30.0, "°")
        for name, window in [("first", self.HOVER), ("second", self.AGAIN), ("last", self.LAST)]:
            level(verdict, f"{name} hover", between(rows, window))
        begin, end = self.PUNCH
        # For the attitude, the flight controller takes from one motor what it cannot give to another: the fastest has it
        # all. In a climb a propeller takes less than where it stands, for which the best is computed.
        row, rpm = max(((row, max(row["rpm"])) for row in between(rows, (end - 0.3, end))), key=lambda seen: seen[1])
        missing = 1.0 - rpm / plant().best_rpm(row["supply_v"], 0.0)
        verdict.at_most("speed missing at full throttle", 100 * missing, 3.0, " %")
        # At the end of a pack they take what it has: its voltage stays just above the limit.
        least_v = bench(BENCH)["params"]["LIM_BUS_V_MIN"]
        sagged = [row["supply_v"] for row in between(rows, (self.SAG[0] + 0.1, self.SAG[1]))]
        verdict.at_most("empty pack below LIM_BUS_V_MIN", least_v - min(sagged), 0.0, " V")
        verdict.at_most("empty pack above LIM_BUS_V_MIN", sum(sagged) / len(sagged) - least_v, 0.6, " V")
        fallen = between(rows, self.CUT)
        verdict.at_most("speed at rest in the fall", max(abs(rpm) for rpm in fallen[-1]["rpm"]), 10.0, " rpm")
        hovers = [rpm for row in between(rows, self.HOVER) for rpm in row["rpm"]]
        again = next(row["s"] for row in between(rows, (self.CAUGHT_S, self.END_S)) if min(row["rpm"]) > min(hovers))
        verdict.at_most("from rest to the speed that hovers", again - self.CAUGHT_S, 0.2, " s")


def plant() -> Plant:
    tables = bench(BENCH)
    return plant_of(tables["bench"]["motor"], tables["bench"]["load"], tables["params"], {})
