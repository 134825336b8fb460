"""The top speed that `siskin tune` tells is that of the emulator's motor without a propeller."""

import json
import subprocess

import pytest

from emulator import run
from motors import toml
from paths import TOOL
from thrust import bench

NEAR = 0.05
"""What dead times may change: two of 500 ns are 4.8 % of a period of 48 kHz."""

SPEED, VOLTAGE = 0, 2
SIX_STEP = 1
SINE = 1
WEAKENED = {"CTL_MODE": SPEED, "CTL_RPM_MAX": 12_000}


def tune(supply_v: float, params: dict, *options: str) -> str:
    words = [f"--param={name}={value}" for name, value in (bench("bare")["params"] | params).items()]
    command = [str(TOOL), "tune", "--supply", str(supply_v), *words, *options]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def full_rpm(folder, supply_v: float, params: dict) -> float:
    """Returns the speed at full throttle in the emulator."""
    throttle = [(0.0, 0.0), (0.5, 0.3), (1.0, 1.0)]
    scenario = folder / "top.toml"
    tables = {
        "[bench]": {"base": "bare", "plant": "switching", "bus": supply_v, "duration_s": 3.0},
        "[params]": params,
    }
    text = [f"{name}\n{toml(table)}" for name, table in tables.items()]
    text += [f"[[signal]]\n{toml({'at_s': at_s, 'throttle': share})}" for at_s, share in throttle]
    text.append(f"[[window]]\n{toml({'name': 'full', 't0_s': 2.5, 't1_s': 3.0})}")
    scenario.write_text("\n".join(text))
    ended = run("scenario", scenario, "--json")
    assert ended.returncode == 0, ended.stderr
    told = json.loads(ended.stdout)
    assert told["faults"] == []
    (full,) = [window for window in told["windows"] if window["name"] == "full"]
    return full["rpm_mean"]


@pytest.mark.parametrize(
    ("supply_v", "params", "bound"),
    [
        (24.0, {"CTL_MODE": SPEED, "CTL_RPM_MAX": 5000}, "CTL_RPM_MAX"),
        (24.0, WEAKENED | {"CTL_WEAKEN": 0}, "supply"),
        (16.0, WEAKENED | {"CTL_WEAKEN": 20}, "CTL_WEAKEN"),
        (16.0, WEAKENED, "CTL_WEAKEN"),
        (19.0, WEAKENED, "LIM_BUS_V_MAX"),
        (24.0, WEAKENED | {"CTL_MODE": VOLTAGE}, "LIM_BUS_V_MAX"),
        (16.0, WEAKENED | {"CTL_MODE": VOLTAGE}, "throttle"),
        (19.0, WEAKENED | {"CTL_MODULATION": SINE, "CTL_WEAKEN": 0}, "supply"),
        (24.0, {"CTL_MODE": VOLTAGE, "CTL_DRIVE": SIX_STEP, "CTL_RPM_MAX": 4000, "PWM_FREQ_HZ": 24_000}, "PWM_FREQ_HZ"),
    ],
)
def test_the_emulator_s_motor_turns_as_fast_as_it_is_told(tmp_path, supply_v, params, bound):
    params = {"PWM_FREQ_HZ": 48_000} | params
    told = json.loads(tune(supply_v, params, "--json", "--top-speed"))["top_speed"]
    lowest = told["bounds"][0]
    assert lowest["name"] == bound and lowest["rpm"] == min(each["rpm"] for each in told["bounds"])
    assert told["turn_periods"] == pytest.approx(params["PWM_FREQ_HZ"] / (12 * lowest["rpm"] / 60), abs=0.1)
    assert full_rpm(tmp_path, supply_v, params) == pytest.approx(lowest["rpm"], rel=NEAR)


def test_the_text_has_the_same():
    params = WEAKENED | {"PWM_FREQ_HZ": 48_000}
    told = json.loads(tune(19.0, params, "--json", "--top-speed"))["top_speed"]
    heads, *lines, periods = tune(19.0, params).split("\ntop speed ")[1].splitlines()
    assert heads == "at 19 V without a propeller, the lowest counts"
    shown = [line.split()[:3] for line in lines]
    assert shown == [[each["name"], f"{each['rpm']:.0f}", "rpm"] for each in told["bounds"]]
    assert periods.endswith(f" {told['turn_periods']}")


def test_what_is_not_known_or_makes_no_drive_is_said():
    unknown = subprocess.run([str(TOOL), "tune"], capture_output=True, text=True, timeout=60).stdout
    assert "\nPWM_FREQ_HZ " in unknown.split("top speed ")[1] and "\nsupply " not in unknown
    refused = tune(24.0, {"PWM_FREQ_HZ": 8000, "CTL_RPM_MAX": 12_000})
    assert "no drive: PWM_FREQ_HZ: too few periods a turn at CTL_RPM_MAX" in refused
    told = json.loads(tune(24.0, {"PWM_FREQ_HZ": 8000, "CTL_RPM_MAX": 12_000}, "--json", "--top-speed"))
    assert told["top_speed"] is None


def test_the_top_speed_is_no_setting_unless_it_is_asked_for():
    params = {"PWM_FREQ_HZ": 48_000}
    settings = json.loads(tune(24.0, params, "--json"))
    told = json.loads(tune(24.0, params, "--json", "--top-speed"))
    assert told.pop("top_speed") and told == settings
    assert all(isinstance(value, int | float) for value in settings.values())


@pytest.mark.parametrize("supply_v", [8.9, 30.1])
def test_a_supply_that_would_keep_the_motor_off_is_refused(supply_v):
    command = [str(TOOL), "tune", "--supply", str(supply_v)]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert ended.returncode != 0 and ended.stdout == ""
    assert ended.stderr.splitlines()[0].endswith(
        f"--supply {supply_v} is not within LIM_BUS_V_MIN, 9 V, and LIM_BUS_V_MAX, 30 V"
    )
