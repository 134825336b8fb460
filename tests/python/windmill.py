"""A throttle cut in the wind: it turns the propeller backwards, and throttle is to turn it forwards again.

    target/venv/bin/python tests/python/windmill.py --motors 20 --jobs 2

plays each of this many random motors, known and unknown, with both ways to stop and winds from below up to 0.8 of the
half throttle's speed, and prints a row for each; it exits with status 1 if one does not come back in time.
"""

import random
import sys
from dataclasses import dataclass
from itertools import product
from math import sqrt, tau
from pathlib import Path

import campaign
import paths

sys.path.insert(0, str(paths.DIALECT))

from emulator import MOTOR  # noqa: E402  (it needs the dialect's folder)
from motors import FROM_MOTOR, flown, log_uniform, tune  # noqa: E402
from slams import VOLTAGE  # noqa: E402

WINDS = [0.3, 0.6, 0.8]
KNOWN, UNKNOWN = True, False
COAST, BRAKE = 0, 1
STOPS = {"coast": COAST, "brake": BRAKE}
THROTTLE = 0.5
BLOWS_S, CUT_S, AGAIN_S, END_S = 3.0, 3.5, 5.0, 7.5
FORWARDS_S = {KNOWN: 0.5, UNKNOWN: 1.0}
"""From the throttle to the last moment at which the propeller may stand or turn backwards."""


@dataclass(frozen=True)
class Outcome:
    """What throttle has done to a propeller in the wind."""

    told: list
    """Faults and warnings."""
    wind_rpm: float
    cut_rpm: float
    """Just before the throttle."""
    least_rpm: float
    """The lowest from the moment on at which it must turn forwards."""
    speed: float
    """At the end, over that before the cut."""
    current: float
    """The largest of a phase, over LIM_PHASE_A."""

    def holds(self) -> bool:
        return not self.told and self.least_rpm > 0 and self.speed > 0.9


def market_motor(draw: random.Random) -> dict[str, dict]:
    """Draws a motor with its propeller and supply from what is sold, by the propeller's diameter: 3 to 30 inches.

    Returns a scenario's tables. The propeller's power coefficient and tip speed give the power, the tip speed and the
    supply the flux, and the power the limits.
    """
    inches = log_uniform(draw, 3.0, 30.0)
    diameter_m = 0.0254 * inches
    rad_s = draw.uniform(110.0, 180.0) / (diameter_m / 2)
    drag = draw.uniform(0.03, 0.07) / tau**3 * 1.2 * diameter_m**5
    power_w = drag * rad_s**3
    cells = next((n for n in (2, 3, 4, 6) if power_w < 60 * n**1.6), 12)
    supply_v = 3.9 * cells
    pole_pairs = draw.choice([6, 7]) if inches < 9 else draw.choice([7, 11, 12, 14, 20, 21])
    flux_wb = supply_v / (sqrt(3) * rad_s / draw.uniform(0.62, 0.8)) / pole_pairs
    torque_a = drag * rad_s**2 / (1.5 * pole_pairs * flux_wb)
    limit_a = min(180.0, draw.uniform(1.5, 2.5) * torque_a)
    resistance_ohm = draw.uniform(0.04, 0.12) * supply_v / sqrt(3) / torque_a
    blade = 3.8e-6 * (inches / 5) ** 3.8 * draw.uniform(0.5, 1.2)
    bell = 2.5e-6 * (inches / 5) ** 3.4 * draw.uniform(0.5, 1.2)
    dead_time_ns = draw.choice([200, 300, 500, 750])
    params = {
        "MOT_POLE_PAIRS": pole_pairs,
        "MOT_R_MOHM": 1e3 * resistance_ohm,
        "MOT_L_UH": 1e6 * resistance_ohm * draw.uniform(2e-4, 5e-4),
        "MOT_FLUX_MWB": 1e3 * flux_wb,
        "MOT_J_GCM2": 1e7 * (blade + bell),
        "LIM_PHASE_A": limit_a,
        "LIM_BUS_A": limit_a,
        "LIM_BUS_V_MAX": min(60.0, 1.25 * supply_v),
        "LIM_BUS_V_MIN": 0.6 * supply_v,
        "PWM_DEADTIME_NS": dead_time_ns,
        "CTL_MODE": VOLTAGE,
        "CTL_RPM_MAX": rad_s * 60 / tau,
        **dict.fromkeys(FROM_MOTOR, 0),
    }
    params["PWM_FREQ_HZ"] = tune(params)["PWM_FREQ_HZ"]
    return {
        "bench": {
            "bus": supply_v,
            "dead_time_ns": float(dead_time_ns),
            "adc_range_a": 2 * limit_a,
            "noise_a": 0.05 / 20 * limit_a,
            "board_k_per_w": 0.5,
            "initial_angle_deg": draw.uniform(-180.0, 180.0),
        },
        "bench.motor": {
            "name": f"for {inches:.1f} inches",
            "R": resistance_ohm,
            "L": params["MOT_L_UH"] * 1e-6,
            "flux": flux_wb,
            "pole_pairs": pole_pairs,
            "J": bell,
            "cogging_nm": draw.uniform(0.0, 0.02) * drag * rad_s**2,
            "cogging_order": 12 * pole_pairs,
            "friction_nm": draw.uniform(0.002, 0.008) * drag * rad_s**2,
        },
        "bench.scale": {key: draw.uniform(0.8, 1.2) for key in "RLJ"} | {"flux": draw.uniform(0.95, 1.05)},
        "bench.load": {"name": "propeller", "c2": drag, "J": blade},
        "params": params,
    }


def told(tables: dict[str, dict], known: bool, stop: int) -> dict[str, dict]:
    """Returns the tables for a motor that the ESC knows, or does not."""
    params = tables["params"] | {"MOT_STOP": stop}
    if not known:
        params |= {**dict.fromkeys(MOTOR, 0), "CTL_DRIVE": 2}
    return tables | {"params": params}


def half_rpm(folder: Path, tables: dict[str, dict]) -> float:
    """Returns the speed at half throttle, in calm air."""
    windows = {"half": (BLOWS_S - 0.1, BLOWS_S)}
    tables["bench"]["duration_s"] = BLOWS_S
    _, seen = flown(folder, tables, [(0.0, 0.0), (0.5, THROTTLE)], windows)
    return seen["half"]["rpm_mean"]


def blown(folder: Path, tables: dict[str, dict], known: bool, wind_rpm: float) -> Outcome:
    """Blows against a motor from below while it turns, through a throttle cut, and through what comes then."""
    tables["bench"]["duration_s"] = END_S
    throttle = [(0.0, 0.0), (0.5, THROTTLE), (CUT_S, 0.0), (AGAIN_S, THROTTLE)]
    gust = {"at_s": BLOWS_S, "kind": "gust", "value": -wind_rpm}
    windows = {
        "before": (CUT_S - 0.1, CUT_S),
        "cut": (AGAIN_S - 0.05, AGAIN_S),
        "again": (AGAIN_S, END_S),
        "forwards": (AGAIN_S + FORWARDS_S[known], END_S),
        "end": (END_S - 0.1, END_S),
    }
    warned, found = flown(folder, tables, throttle, windows, (gust,))
    return Outcome(
        warned,
        wind_rpm,
        found["cut"]["rpm_mean"],
        found["forwards"]["rpm_min"],
        found["end"]["rpm_mean"] / found["before"]["rpm_mean"],
        found["again"]["current_max_a"] / tables["params"].get("LIM_PHASE_A", float("inf")),
    )


def drawn(folder: Path, number: int, known: bool, stop: int, wind: float) -> Outcome:
    """Blows against the random motor of this number."""
    tables = told(market_motor(random.Random(f"windmill {number}")), known, stop)
    return blown(folder, tables, known, wind * half_rpm(folder, tables))


def main() -> int:
    given = campaign.words(__doc__, motors=20)
    cases = list(product(campaign.numbers(given), (KNOWN, UNKNOWN), STOPS, WINDS))
    outcomes = []
    print(f"{'motor':>5} {'known':<5} {'stop':<5} {'wind':>4} {'held':<4} {'wind':>6} {'cut':>6} {'least':>6}  end  A")
    for (number, known, stop, wind), outcome in campaign.played(
        cases, lambda folder, case: drawn(folder, case[0], case[1], STOPS[case[2]], case[3]), given.jobs
    ):
        outcomes.append(outcome)
        held = "yes" if outcome.holds() else "NO"
        figures = f"{outcome.wind_rpm:>6.0f} {outcome.cut_rpm:>6.0f} {outcome.least_rpm:>6.0f}"
        ends = f"{outcome.speed:>4.2f} {outcome.current:>4.2f}"
        row = f"{number:>5} {known!s:<5} {stop:<5} {wind:>4} {held:<4} {figures} {ends}"
        print(f"{row}  {', '.join(map(str, outcome.told))}".rstrip(), flush=True)
    held = sum(outcome.holds() for outcome in outcomes)
    print(f"{held} of {len(outcomes)} come back")
    return 0 if held == len(outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
