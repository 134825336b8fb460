"""What a flight must keep to, and its figures."""

import bisect

import dshot
from flight import STEP_NS
from plan import Plan

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


def judge(plan: Plan, rows: list[dict], escs: list, summary: list[dict]) -> Verdict:
    """Judges a flight: its rows, what was seen of the ESCs, and the emulator's final summary of them."""
    verdict = Verdict()
    plan.judge(verdict, rows)
    for index, (esc, told) in enumerate(zip(escs, summary, strict=True)):
        name = f"ESC {index + 1}"
        verdict.at_most(f"{name} starts beside {plan.STARTS}", abs(esc.starts - plan.STARTS), 0)
        verdict.at_most(f"{name} faults", esc.faults + len(told["faults"]), 0)
        verdict.at_most(f"{name} locks lost", sum(window["lock_lost"] for window in told["windows"]), 0)
        wire(verdict, name, plan, rows, index, esc)
    return verdict


def between(rows: list[dict], window: tuple[float, float]) -> list[dict]:
    return [row for row in rows if window[0] <= row["s"] < window[1]]


def between_times(times: list[int], begin: float, end: float) -> list[int]:
    return times[bisect.bisect_left(times, begin) : bisect.bisect_right(times, end)]


def off(rpm: float, true: float) -> float:
    """Returns the share by which a speed is off; large for a propeller that stands."""
    return abs(rpm - true) / max(true, 1.0)


def level(verdict: Verdict, name: str, rows: list[dict]) -> None:
    for axis in ("roll", "pitch"):
        verdict.at_most(f"{axis} in the {name}", max(abs(row[axis]) for row in rows), 1.0, "°")
    apart = max(off(rpm, sum(row["rpm"]) / 4) for row in rows for rpm in row["rpm"])
    verdict.at_most(f"speeds apart in the {name}", 100 * apart, 2.0, " %")


def wire(verdict: Verdict, name: str, plan: Plan, rows: list[dict], index: int, esc) -> None:
    """Judges an ESC's replies, decoded here and not by what sent them."""
    # At first it has yet to detect its wire's signal; and the reply to a frame just before the end comes after it.
    sent = between_times(esc.sent, LISTENS_S * 1e9, rows[-1]["s"] * 1e9 - REPLY_NS)
    answered = between_times([began for began, _ in esc.replies], LISTENS_S * 1e9, sent[-1] + TIMER_NS)
    verdict.at_most(f"{name} frames beside {len(sent)} replies", abs(len(sent) - len(answered)), 0)
    verdict.at_most(f"{name} replies' frames off", max(abs(a - b) for a, b in zip(answered, sent)), TIMER_NS, " ns")
    told = [(began * 1e-9, dshot.erpm(data) / POLE_PAIRS) for began, data in esc.replies if not dshot.is_extended(data)]
    hovers = flies = 0.0
    for at_s, rpm in told:
        if plan.FLIES[0] <= at_s < plan.FLIES[1]:
            far = off(rpm, rows[round(at_s * 1e9) // STEP_NS]["rpm"][index])
            flies = max(flies, far)
            if any(begin <= at_s < end for begin, end in plan.STEADY):
                hovers = max(hovers, far)
    verdict.at_most(f"{name} replies off in hover", 100 * hovers, 2.0, " %")
    verdict.at_most(f"{name} replies off in flight", 100 * flies, 20.0, " %")
