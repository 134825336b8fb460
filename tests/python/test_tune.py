"""Motors that nobody has tuned by hand start and follow the throttle with the settings that follow from them."""

import json
import math
import random
import subprocess

import pytest

from emulator import scenario
from paths import TOOL


def tune(*words) -> dict:
    ended = subprocess.run([str(TOOL), "tune", "--json", *words], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


# What follows from the motor where it is 0.
FROM_MOTOR = """CTL_RPM_MIN CTL_SLEW_RPM_S CTL_BW_CUR_HZ CTL_BW_SPD_HZ STA_PARK_AS STA_RAMP_A STA_RAMP_RPM_S
    STA_RUN_RPM""".split()


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


def flight(motor: dict, params: dict, plant: str) -> str:
    """At 0.5 s the throttle goes to 30 %, and at 2.5 s to 90 %."""
    of = motor["params"]
    # Half of the inertia is the bell's.
    j = of["MOT_J_GCM2"] * 1e-7 / 2
    tables = [
        (
            "[bench]",
            {
                "bus": motor["supply_v"],
                "adc_range_a": 2 * of["LIM_PHASE_A"],
                "duration_s": 3.5,
                "plant": plant,
                "initial_angle_deg": motor["angle_deg"],
            },
        ),
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
        ("[[window]]", {"name": "end", "t0_s": 3.4, "t1_s": 3.5}),
    ]
    return "\n".join(f"{head}\n{toml(table)}" for head, table in tables)


def flown(folder, number: int, plant: str) -> tuple[bool, bool]:
    """Whether a drawn motor turns in the end, without a fault, and whether it does so at the first attempt."""
    motor = motor_of(random.Random(number))
    words = [f"--param={name}={value:.6g}" for name, value in motor["params"].items()]
    followed = tune(*words)
    assert followed.keys() == {*FROM_MOTOR, "PWM_FREQ_HZ"}
    params = {**motor["params"], "PWM_FREQ_HZ": followed["PWM_FREQ_HZ"], **dict.fromkeys(FROM_MOTOR, 0)}
    file = folder / "drawn.toml"
    file.write_text(flight(motor, params, plant))
    status, found = scenario(file)
    assert status == 0, number
    windows = {window["name"]: window for window in found["windows"]}
    turns = found["faults"] == [] and windows["end"]["rpm_mean"] > followed["CTL_RPM_MIN"]
    # Speed mode: from CTL_RPM_MIN to CTL_RPM_MAX.
    wanted = followed["CTL_RPM_MIN"] + 0.3 * (motor["rpm"] - followed["CTL_RPM_MIN"])
    follows = windows["slow"]["rpm_mean"] == pytest.approx(wanted, rel=0.03)
    at_once = windows["all"]["starts"] == 1 and not windows["all"]["lock_lost"]
    return turns, turns and follows and at_once


# The ripple of the switching plant is one more thing that the ramp's estimate has to live with.
@pytest.mark.parametrize(("plant", "motors", "again_share"), [("averaged", 120, 0.05), ("switching", 20, 0.2)])
def test_motors_that_nobody_tuned_start_and_follow_the_throttle(tmp_path, plant, motors, again_share):
    flights = {number: flown(tmp_path, number, plant) for number in range(motors)}
    assert [number for number, (turns, _) in flights.items() if not turns] == []
    again = [number for number, (_, at_once) in flights.items() if not at_once]
    assert len(again) <= again_share * motors, again
