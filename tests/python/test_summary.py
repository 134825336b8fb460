"""The summary at the end of a run: its keys, and that it is reproducible."""

import math

import pytest

from emulator import scenario, simulate, windows_of
from paths import SCENARIOS

KEYS = {"sim_s", "wall_s", "sim_per_wall", "steps", "trace_hash", "faults", "windows"}
WINDOW_KEYS = set(
    """
    name t0_s t1_s rpm_mean rpm_min rpm_max rpm_ref_mean speed_error_rms_rpm speed_error_max_rpm
    speed_estimate_error_rms_rpm angle_error_mean_deg angle_error_rms_deg angle_error_std_deg
    angle_error_max_deg lock_s torque_mean_nm torque_ripple_pct p_motor_w p_copper_w efficiency
    i_q_mean_a i_d_mean_a current_max_a r_error_max_pct flux_error_max_pct bus_v_mean bus_a_mean
    turned_back_deg reached_s settled_s starts lock_lost
    """.split()
)


def test_a_run_ends_with_the_documented_keys():
    summary = simulate("--duration", "0.5")
    assert KEYS <= set(summary)
    assert summary["sim_s"] == pytest.approx(0.5, abs=0.002)
    assert summary["steps"] == pytest.approx(0.5 * 24_000, abs=48)
    assert summary["faults"] == []
    assert len(summary["trace_hash"]) == 16
    int(summary["trace_hash"], 16)


def test_the_hash_follows_seed_and_inputs_and_nothing_else():
    def trace(*arguments: object) -> str:
        return simulate("--duration", "0.5", *arguments)["trace_hash"]

    first = trace("--seed", 7)
    assert trace("--seed", 7) == first
    assert trace("--seed", 7, "--bus", "23") != first
    switching = trace("--seed", 7, "--plant", "switching", "--bus", "23")
    assert trace("--seed", 7, "--plant", "switching", "--bus", "23") == switching


def test_a_scenario_repeats_itself_for_equal_seeds_only():
    def trace(*arguments: object) -> str:
        return scenario(SCENARIOS / "half-throttle.toml", *arguments)[1]["trace_hash"]

    first = trace()
    assert trace() == first, "the file's seed is 1"
    assert trace("--seed", 1) == first
    assert trace("--seed", 2) != first, "another seed makes other noise"


def test_a_scenario_has_every_figure_and_no_nan():
    status, summary = scenario(SCENARIOS / "half-throttle.toml")
    assert status == 0
    assert KEYS | {"expectations"} <= set(summary)
    windows = windows_of(summary)
    for window in windows.values():
        assert WINDOW_KEYS <= set(window)
        assert all(not isinstance(v, float) or math.isfinite(v) for v in window.values())
    held = windows["held"]
    assert held["rpm_min"] <= held["rpm_mean"] <= held["rpm_max"]
    square = held["angle_error_mean_deg"] ** 2 + held["angle_error_std_deg"] ** 2
    assert held["angle_error_rms_deg"] ** 2 == pytest.approx(square)
    assert held["speed_error_max_rpm"] >= held["speed_error_rms_rpm"]
    assert held["current_max_a"] > held["i_q_mean_a"] > 0.0
    assert (held["starts"], held["turned_back_deg"]) == (0, 0.0)
    assert held["reached_s"] == held["settled_s"] == pytest.approx(0.0, abs=1e-4)
    assert held["efficiency"] == pytest.approx(1 - held["p_copper_w"] / held["p_motor_w"])
    assert 0.8 < held["efficiency"] < 1.0
    assert held["bus_v_mean"] == pytest.approx(24.0, abs=0.2)
    assert held["bus_a_mean"] == pytest.approx(held["p_motor_w"] / held["bus_v_mean"], rel=0.05)
    assert held["lock_lost"] is False
    assert windows["arming"]["efficiency"] is None, "no data is null"


SWEPT = """
[bench]
duration_s = 0.05
[sweep]
"bench.bus" = [20.0, 24.0]
[random]
"bench.initial_angle_deg" = [-180.0, 180.0]
[[expect]]
window = "run"
key = "bus_v_mean"
below = 22.0
"""


def test_a_sweep_ends_with_its_worst_run_which_can_be_made_alone(tmp_path):
    path = tmp_path / "swept.toml"
    path.write_text(SWEPT)
    status, summary = scenario(path, "--seeds", "1..3")
    assert (status, summary["runs"], summary["failed"], summary["faults"]) == (1, 6, 3, {})
    assert len(summary["trace_hash"]) == 16
    [expected] = summary["expectations"]
    assert expected["failed"] == 3
    assert expected["worst"] == pytest.approx(24.0)
    assert expected["where"]["set"] == {"bench.bus": 24.0}
    assert expected["options"] == "--seed 1 --set bench.bus=24.0"
    assert len(summary["failures"]) == 3

    status, alone = scenario(path, *expected["options"].split())
    assert status == 1
    assert alone["expectations"][0]["value"] == expected["worst"]
    assert alone["drawn"] == expected["where"]["drawn"]
    assert -180.0 <= alone["drawn"]["bench.initial_angle_deg"] <= 180.0

    record = tmp_path / "alone.csv"
    options = ("--seed", 1, "--set", "bench.bus=20.0", "--record", record)
    assert scenario(path, *options)[0] == 0
    assert record.stat().st_size > 0


def test_an_expectation_that_fails_is_status_1(tmp_path):
    path = tmp_path / "fails.toml"
    path.write_text(
        """
        [bench]
        duration_s = 0.1
        [[window]]
        name = "all"
        t0_s = 0.0
        t1_s = 0.1
        [[expect]]
        window = "all"
        key = "rpm_mean"
        above = 1000.0
        """
    )
    status, summary = scenario(path)
    assert status == 1
    assert [expected["held"] for expected in summary["expectations"]] == [False]
