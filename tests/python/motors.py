"""Motors of any size, drawn at random, what follows from them, and benches with them."""

import json
import math
import random
import subprocess
from pathlib import Path

from emulator import SETTINGS, scenario, windows_of
from paths import TOOL


# Resistance of a phase's current path through the board: two transistors and a shunt, as in the emulator.
BOARD_OHM = 6e-3

# What follows from the motor where it is 0.
FROM_MOTOR = ["CTL_RPM_MIN", *SETTINGS]


def tune(params: dict) -> dict:
    """Returns the settings that `siskin tune` makes of these parameters."""
    words = [f"--param={name}={value:.6g}" for name, value in params.items()]
    ended = subprocess.run([str(TOOL), "tune", "--json", *words], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


def toml(table: dict) -> str:
    return "\n".join(f"{key} = {json.dumps(value)}" for key, value in table.items())


def motor_of(draw: random.Random) -> dict:
    """Draws a motor with its propeller, supply and limits, of any size from a 3-inch one to a 3 kW lift motor.

    Speed falls and supply rises with power; at full throttle the propeller takes all of it, at the limit R drops 5 to
    15 % of the supply, and the limit's torque takes 24 to 150 ms to full speed without the load.
    """
    size = draw.uniform(0.25, 1.0)
    power_w = 10 ** (1.2 + 2.3 * size) * draw.uniform(0.7, 1.4)
    supply_v = min(45.0, 3.7 * 10 ** (1.1 * size) * draw.uniform(0.8, 1.3))
    rpm = 50_000 * 10**-size * draw.uniform(0.6, 1.4)
    pole_pairs = draw.choice([6, 7, 7, 11, 12, 14, 14, 20, 21] if size > 0.5 else [6, 7, 7])
    flux_wb = 60 / (math.tau * math.sqrt(3) * pole_pairs * rpm / 0.75 / supply_v)
    limit_a = 1.6 * power_w / supply_v + 2
    resistance_ohm = draw.uniform(0.05, 0.15) * supply_v / (math.sqrt(3) * limit_a)
    rad_s = rpm * math.tau / 60
    inertia = 1.5 * pole_pairs * flux_wb * limit_a * draw.uniform(0.024, 0.15) / rad_s
    return {
        "supply_v": supply_v,
        "rpm": rpm,
        "angle_deg": draw.uniform(-180.0, 180.0),
        "drag": 0.8 * power_w / rad_s**3,
        "params": {
            "MOT_POLE_PAIRS": pole_pairs,
            "MOT_R_MOHM": 1e3 * resistance_ohm,
            "MOT_L_UH": 1e6 * resistance_ohm * draw.uniform(1.5e-4, 8e-4),
            "MOT_FLUX_MWB": 1e3 * flux_wb,
            "MOT_J_GCM2": 1e7 * inertia,
            "LIM_PHASE_A": limit_a,
            "LIM_BUS_V_MAX": 1.25 * supply_v,
            "LIM_BUS_V_MIN": 0.6 * supply_v,
            "PWM_DEADTIME_NS": draw.choice([200, 300, 500]),
            "CTL_RPM_MAX": rpm,
        },
    }


def log_uniform(draw: random.Random, least: float, most: float) -> float:
    return math.exp(draw.uniform(math.log(least), math.log(most)))


def any_motor(draw: random.Random) -> dict:
    """Draws a motor with its propeller, supply, limits and PWM, from the smallest to the largest that exist.

    R is 5 mOhm to 5 Ohm, L 3 uH to 2 mH, the flux 0.1 to 30 mWb, with 1 to 30 pole pairs and 5 to 50 V; the electrical
    speed that the supply allows is up to a twentieth of the PWM frequency. The limit drops 3 to 15 % of the supply
    across R, and takes 24 to 300 ms to full speed without the load, which takes half of its torque there.
    """
    while True:
        supply_v, limit_a = log_uniform(draw, 5.0, 50.0), log_uniform(draw, 0.7, 100.0)
        pwm_hz = draw.choice([24e3, 48e3])
        phase_v = supply_v / math.sqrt(3)
        resistance_ohm = log_uniform(draw, 0.03, 0.15) * phase_v / limit_a
        inductance_h = resistance_ohm * log_uniform(draw, 1.5e-4, 8e-4)
        flux_wb = phase_v / (math.tau * log_uniform(draw, 0.02, 0.05) * pwm_hz)
        if 5e-3 < resistance_ohm < 5 and 3e-6 < inductance_h < 2e-3 and 1e-4 < flux_wb < 3e-2:
            break
    pole_pairs = draw.randint(1, 30)
    rad_s = 0.75 * phase_v / flux_wb / pole_pairs
    torque_nm = 1.5 * pole_pairs * flux_wb * limit_a
    return {
        "supply_v": supply_v,
        "rpm": rad_s * 60 / math.tau,
        "angle_deg": draw.uniform(-180.0, 180.0),
        "drag": 0.5 * torque_nm / rad_s**2,
        "params": {
            "MOT_POLE_PAIRS": pole_pairs,
            "MOT_R_MOHM": 1e3 * resistance_ohm,
            "MOT_L_UH": 1e6 * inductance_h,
            "MOT_FLUX_MWB": 1e3 * flux_wb,
            "MOT_J_GCM2": 1e7 * torque_nm * log_uniform(draw, 0.024, 0.3) / rad_s,
            "LIM_PHASE_A": limit_a,
            "LIM_BUS_A": limit_a,
            "LIM_BUS_V_MAX": min(60.0, 1.25 * supply_v),
            "LIM_BUS_V_MIN": 0.6 * supply_v,
            "PWM_FREQ_HZ": pwm_hz,
            "PWM_DEADTIME_NS": draw.choice([200, 300, 500]),
            "CTL_RPM_MAX": rad_s * 60 / math.tau,
        },
    }


def drawn_bench(motor: dict) -> dict[str, dict]:
    """Returns a scenario's tables with a drawn motor: half of its inertia is the bell's.

    The board suits the limit: it measures twice as much, with noise of 0.05 A per 40 A, and is a small one of 6 K/W,
    or one that is 60 K warmer than the air at that current.
    """
    of = motor["params"]
    heat_w = 1.5 * BOARD_OHM * of["LIM_PHASE_A"] ** 2
    j = of["MOT_J_GCM2"] * 1e-7 / 2
    range_a = 2 * of["LIM_PHASE_A"]
    return {
        "bench": {
            "bus": motor["supply_v"],
            "dead_time_ns": float(of["PWM_DEADTIME_NS"]),
            "adc_range_a": range_a,
            "noise_a": 0.05 / 40 * range_a,
            "board_k_per_w": min(6.0, 60 / heat_w),
            "initial_angle_deg": motor["angle_deg"],
        },
        "bench.motor": {
            "name": "drawn",
            "R": of["MOT_R_MOHM"] * 1e-3,
            "L": of["MOT_L_UH"] * 1e-6,
            "flux": of["MOT_FLUX_MWB"] * 1e-3,
            "pole_pairs": of["MOT_POLE_PAIRS"],
            "J": j,
        },
        "bench.load": {"name": "propeller", "c2": motor["drag"], "J": j},
    }


def written(folder, tables: dict, throttle: list, windows: dict, faults: tuple = ()) -> Path:
    """Writes a scenario with these tables, times and throttles, windows by name, and tables of what goes wrong."""
    heads = [(f"[{name}]", table) for name, table in tables.items()]
    heads += [("[[signal]]", {"at_s": at_s, "throttle": share}) for at_s, share in throttle]
    heads += [("[[window]]", {"name": name, "t0_s": t0, "t1_s": t1}) for name, (t0, t1) in windows.items()]
    heads += [("[[fault]]", fault) for fault in faults]
    file = folder / "flight.toml"
    file.write_text("\n".join(f"{head}\n{toml(table)}" for head, table in heads))
    return file


def flown(folder, tables: dict, throttle: list, windows: dict, faults: tuple = ()) -> tuple[list, dict]:
    """Plays what `written` writes; returns its faults and warnings, and its windows by name."""
    status, found = scenario(written(folder, tables, throttle, windows, faults))
    assert status == 0
    return found["faults"] + found.get("warnings", []), windows_of(found)
