"""Each of the repository's scenarios holds what it expects."""

import pytest

from emulator import scenario
from paths import SCENARIOS

FAULTS = {
    "fault-blocked": "rotor position lost",
    "fault-blocked-start": "motor does not start",
    "fault-disconnect": "under-voltage",
    "fault-disconnect-braking": "over-voltage",
    "fault-jam": "rotor position lost",
    "fault-jam-quad": "rotor position lost",
    "fault-sag": "under-voltage",
    "fault-sag-flight": "under-voltage",
    "fault-sensor-full": "over-current",
    "fault-sensor-start": "current sensor",
    "over-current": "over-current",
    "over-temperature": "over-temperature",
    "over-voltage": "over-voltage",
    "trip-weakened": "over-current",
    "under-voltage": "under-voltage",
}

# Warnings expected where the motor carries on; without a fault, none.
WARNINGS = {
    "fault-hall-stuck": {"position sensor defect"},
    "fault-mosfet-open": {"phase open"},
    # 3 A rms on each: no sound sensor shows that.
    "fault-noise": {"current sensor drifts"},
    "fault-offset-drift": {"current sensor drifts"},
    "fault-phase-open": {"phase open"},
    "fault-phase-open-start": {"phase open"},
    "fault-sensor-stuck": {"current sensor drifts"},
}

# Some of the seeds that the files name for all of them.
SEEDS = {
    "bench-cinelifter": "1..4",
    "bench-ducted-fan": "1..4",
    "bench-gimbal": "1..4",
    "bench-helicopter": "1..4",
    "bench-lift-28-inch": "1..4",
    "bench-quad-15-inch": "1..4",
    "bench-quad-3-inch": "1..4",
    "bench-quad-7-inch": "1..4",
    "bench-skateboard": "1..4",
    "bench-whoop": "1..4",
    "catch": "1..3",
    "catch-forwards": "1..3",
    "fault-bit-errors": "1..3",
    "fault-kick": "1..5",
    "fault-mosfet-open": "1..5",
    "fault-mosfet-short": "1..5",
    "fault-mosfet-short-flight": "1..5",
    "fault-phase-open": "1..5",
    "fault-phase-open-start": "1..5",
    "fault-sensor-stuck": "1..5",
    "flight-calm": "1..2",
    "flight-weather": "1..2",
    "hall": "1..20",
    "low-100": "1..5",
    "low-150": "1..5",
    "random-drives": "1..60",
    "random-motors": "1..60",
    "start-inertia": "1..25",
    "start-propeller": "1..200",
    "start-thousand": "1..100",
    "start-wrong-rl": "1..20",
    "switching-100": "1..3",
    "switching-150": "1..3",
    "switching-start": "1..60",
}


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENARIOS.glob("*.toml")))
def test_scenario(name):
    seeds = ["--seeds", SEEDS[name]] if name in SEEDS else []
    status, summary = scenario(SCENARIOS / f"{name}.toml", *seeds)
    expectations = summary["expectations"]
    assert set(summary.get("warnings", [])) == WARNINGS.get(name, set())
    if "runs" in summary:
        failed = [expected for expected in expectations if expected["failed"] > 0]
        assert (status, summary["failed"], failed) == (0, 0, [])
        assert expectations, "it expects nothing"
        return
    failed = [expected for expected in expectations if not expected["held"]]
    assert (status, failed) == (0, [])
    assert expectations, "it expects nothing"
    wanted = FAULTS.get(name)
    if wanted is None:
        assert summary["faults"] == []
    else:
        assert len(summary["faults"]) == 1 and wanted in summary["faults"][0]
