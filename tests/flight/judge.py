"""What a flight must keep to, and its figures."""

import bisect

import dshot
import plan
from body import Body
from flight import STEP_NS

POLE_PAIRS = 7
LISTENS_S = 0.1
REPLY_NS = 100_000
TIMER_NS = 6
"""How closely an ESC's timer sees a frame begin."""


class Verdict:
    """Figures of a flight, each with its bound."""

    def __init__(self):
        self.figures: list[tuple[str, float, float, str]] = []
        """Name, value, maximum, and unit."""

    def at_most(self, what: str, value: float, most: float, unit: str = "") -> None:
        self.figures.append((what, value, most, unit))

    @property
    def broken(self) -> list[tuple]:
        return [figure for figure in self.figures if not figure[1] <= figure[2]]

    def __str__(self) -> str:
        lines = (
            f"{'' if value <= most else 'FAILED: '}{what}: {value:.4g}{unit}, at most {most:g}"
            for what, value, most, unit in self.figures
        )
        return "\n".join(lines)


def judge(rows: list[dict], escs: list, summary: list[dict]) -> Verdict:
    """Judges a flight: its rows, what was seen of the ESCs, and the emulator's final summary of them."""
    verdict = Verdict()
    verdict.at_most("tilt", max(row["tilt"] for row in rows), 60.0, "°")
    for name, window in [("first", plan.HOVER), ("last", plan.LAST_HOVER)]:
        hover(verdict, f"{name} hover", between(rows, window))
    step(verdict, "roll to the right", rows, (plan.RIGHT_S, plan.LEFT_S), 0.0, plan.ROLL_DEG)
    step(verdict, "roll to the left", rows, (plan.LEFT_S, plan.LEVEL_S), plan.ROLL_DEG, -plan.ROLL_DEG)
    step(verdict, "roll back", rows, (plan.LEVEL_S, plan.GUST[0]), -plan.ROLL_DEG, 0.0)
    last = rows[-1]
    verdict.at_most("height after landing", abs(last["height"] - Body.STANDS), 0.005, " m")
    verdict.at_most("fastest at rest", max(abs(rpm) for rpm in last["rpm"]), 0.0, " rpm")
    for index, (esc, told) in enumerate(zip(escs, summary, strict=True)):
        name = f"ESC {index + 1}"
        verdict.at_most(f"{name} starts beside one", abs(esc.starts - 1), 0)
        verdict.at_most(f"{name} faults", esc.faults + len(told["faults"]), 0)
        verdict.at_most(f"{name} locks lost", sum(window["lock_lost"] for window in told["windows"]), 0)
        wire(verdict, name, rows, index, esc)
    return verdict


def between(rows: list[dict], window: tuple[float, float]) -> list[dict]:
    return [row for row in rows if window[0] <= row["s"] < window[1]]


def between_times(times: list[int], begin: float, end: float) -> list[int]:
    return times[bisect.bisect_left(times, begin) : bisect.bisect_right(times, end)]


def off(rpm: float, true: float) -> float:
    """Returns the share by which a speed is off; large for a propeller that stands."""
    return abs(rpm - true) / max(true, 1.0)


def hover(verdict: Verdict, name: str, rows: list[dict]) -> None:
    for axis in ("roll", "pitch"):
        verdict.at_most(f"{axis} in the {name}", max(abs(row[axis]) for row in rows), 1.0, "°")
    verdict.at_most(f"height missed in the {name}", max(abs(row["height"] - plan.HEIGHT_M) for row in rows), 0.15, " m")
    apart = max(off(rpm, sum(row["rpm"]) / 4) for row in rows for rpm in row["rpm"])
    verdict.at_most(f"speeds apart in the {name}", 100 * apart, 2.0, " %")


def step(verdict: Verdict, name: str, rows: list[dict], window: tuple, before: float, after: float) -> None:
    rolls = [row["roll"] for row in between(rows, window)]
    way = after - before
    verdict.at_most(f"end of the {name}", max(abs(roll - after) for roll in rolls[-100:]), 2.0, "°")
    verdict.at_most(f"overshoot of the {name}", 100 * max((roll - after) / way for roll in rolls), 15.0, " %")


def wire(verdict: Verdict, name: str, rows: list[dict], index: int, esc) -> None:
    """Judges an ESC's replies, decoded here and not by what sent them."""
    # At first it has yet to detect its wire's signal; and the reply to a frame just before the end comes after it.
    sent = between_times(esc.sent, LISTENS_S * 1e9, rows[-1]["s"] * 1e9 - REPLY_NS)
    answered = between_times([began for began, _ in esc.replies], LISTENS_S * 1e9, sent[-1] + TIMER_NS)
    verdict.at_most(f"{name} frames beside {len(sent)} replies", abs(len(sent) - len(answered)), 0)
    verdict.at_most(f"{name} replies' frames off", max(abs(a - b) for a, b in zip(answered, sent)), TIMER_NS, " ns")
    told = [(began * 1e-9, dshot.erpm(data) / POLE_PAIRS) for began, data in esc.replies if not dshot.is_extended(data)]
    hovers = flies = 0.0
    for at_s, rpm in told:
        if plan.HOVER[0] <= at_s < plan.LAND_S:
            far = off(rpm, rows[round(at_s * 1e9) // STEP_NS]["rpm"][index])
            flies = max(flies, far)
            if any(begin <= at_s < end for begin, end in (plan.HOVER, plan.LAST_HOVER)):
                hovers = max(hovers, far)
    verdict.at_most(f"{name} replies off in hover", 100 * hovers, 2.0, " %")
    verdict.at_most(f"{name} replies off in flight", 100 * flies, 20.0, " %")
