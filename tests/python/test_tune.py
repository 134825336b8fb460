"""`siskin tune`: motors that nobody has tuned by hand start and follow the throttle with its settings."""

import json
import math
import random
import subprocess

import pytest

from paths import PROGRAM, TOOL

MOTORS = 60
SWITCHING = 6


def tune(*words) -> dict:
    ended = subprocess.run([str(TOOL), "tune", "--json", *words], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


def toml(table: dict) -> str:
    return "\n".join(f"{key} = {json.dumps(value)}" for key, value in table.items())


def motor_of(draw: random.Random) -> dict:
    """A motor with its propeller, supply and limits, of any size from a 3-inch one to a lift of 3 kW.

    Speed falls and supply rises with the power; at full throttle the propeller takes it all, at the limit R drops
    5 to 15 % of the supply, and the limit's torque takes 24 to 150 ms to full speed without the load.
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


def scenario(motor: dict, params: dict, plant: str) -> str:
    """At 0.5 s the throttle goes to 30 %, and at 2.5 s to 90 %."""
    of = motor["params"]
    # Half of the inertia is the bell's.
    j = of["MOT_J_GCM2"] * 1e-7 / 2
    tables = [
        ("[bench]", {"bus": motor["supply_v"], "adc_range_a": 2 * of["LIM_PHASE_A"], "duration_s": 3.5, "plant": plant}),
        (
            "[bench.motor]",
            {
                "name": "drawn",
                "R": of["MOT_R_MOHM"] * 1e-3,
                "L": of["MOT_L_UH"] * 1e-6,
                "flux": of["MOT_FLUX_MWB"] * 1e-3,
                "pole_pairs": of["MOT_POLE_PAIRS"],
                "J": j,
            },
        ),
        ("[bench.load]", {"name": "propeller", "c2": motor["drag"], "J": j}),
        ("[params]", params),
        ("[[signal]]", {"at_s": 0.0, "throttle": 0.0}),
        ("[[signal]]", {"at_s": 0.5, "throttle": 0.3}),
        ("[[signal]]", {"at_s": 2.5, "throttle": 0.9}),
        ("[[window]]", {"name": "all", "t0_s": 0.0, "t1_s": 3.5}),
        ("[[window]]", {"name": "slow", "t0_s": 2.2, "t1_s": 2.5}),
    ]
    return "\n".join(f"{head}\n{toml(table)}" for head, table in tables)


@pytest.mark.parametrize("number", range(MOTORS + SWITCHING))
def test_a_motor_that_nobody_tuned_starts_and_follows_the_throttle(tmp_path, number):
    motor = motor_of(random.Random(number))
    words = [f"--param={name}={value:.6g}" for name, value in motor["params"].items()]
    params = {**motor["params"], **tune(*words)}
    file = tmp_path / "drawn.toml"
    file.write_text(scenario(motor, params, "switching" if number >= MOTORS else "averaged"))
    played = subprocess.run(
        [str(PROGRAM), "scenario", str(file), "--json"], capture_output=True, text=True, timeout=120
    )
    assert played.returncode == 0, played.stderr
    found = json.loads(played.stdout)
    windows = {window["name"]: window for window in found["windows"]}
    assert found["faults"] == [] and not windows["all"]["lock_lost"], found["faults"]
    assert windows["all"]["starts"] == 1, "at the first attempt"
    # Speed mode: from CTL_RPM_MIN to CTL_RPM_MAX.
    wanted = params["CTL_RPM_MIN"] + 0.3 * (motor["rpm"] - params["CTL_RPM_MIN"])
    assert windows["slow"]["rpm_mean"] == pytest.approx(wanted, rel=0.03)
