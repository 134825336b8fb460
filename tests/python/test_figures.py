"""The figures in the READMEs are those that their commands print."""

import re

import pytest

from emulator import scenario, windows_of
from paths import ROOT, SCENARIOS

# Each row's scenario, its seeds and the expectations whose worst values the row has. A row without a figure says that
# none was lost: that is the scenario's own expectation, which test_scenarios.py plays.
ROWS = {
    "robust-steady": (None, ["angle_error_mean_deg", "angle_error_std_deg"]),
    "grid-steady": (None, ["angle_error_max_deg"]),
    "grid-steps": (None, ["angle_error_max_deg"]),
    "flux": (None, ["lock_s"]),
    "low-100": ("1..20", ["angle_error_max_deg"]),
    "low-150": ("1..20", ["angle_error_max_deg"]),
    "start-propeller": None,
    "start-inertia": None,
    "heat": ("1..2", ["r_error_max_pct", "flux_error_max_pct"]),
    "random-drives": None,
    "catch": ("1..20", ["current_max_a"]),
}

# A figure may move by this share of its limit before the table has to be rewritten.
STALE = 0.1


def table() -> dict[str, list[str]]:
    """Returns the cells of the rows, by the scenario in the last one."""
    _, section = (ROOT / "shared" / "README.md").read_text().split("\n### What the default drive holds\n")
    section = section.split("\n## ")[0]
    rows = [[cell.strip() for cell in row.strip("|").split("|")] for row in re.findall(r"^\|.*`.*$", section, re.M)]
    return {row[-1].strip("`"): row for row in rows}


def test_each_row_is_checked():
    assert set(table()) == {*ROWS, "steps"}


@pytest.mark.parametrize("name", [name for name, row in ROWS.items() if row])
def test_a_row_has_what_its_scenario_finds(name):
    seeds, keys = ROWS[name]
    _, limit, worst, _ = table()[name]
    limit = float(re.search(r"[\d.]+", limit.removeprefix("mean and σ"))[0])
    listed = [float(number) for number in re.findall(r"[\d.]+", worst)]
    status, summary = scenario(SCENARIOS / f"{name}.toml", *(["--seeds", seeds] if seeds else []))
    assert status == 0
    worst = {expected["key"]: expected["worst"] for expected in summary["expectations"]}
    found = [worst[key] for key in keys]
    for figure, value in zip(listed, found, strict=True):
        assert abs(figure - abs(value)) <= STALE * limit, f"{name}: {figure} in the table, {value} found"


def test_the_steps_settle_as_the_table_says():
    _, _, worst, _ = table()["steps"]
    settled_s, overshoot_rpm = (float(number) for number in re.findall(r"[\d.]+", worst))
    status, summary = scenario(SCENARIOS / "steps.toml")
    assert status == 0
    windows = windows_of(summary)
    up, down = windows["up"], windows["down"]
    assert abs(max(up["settled_s"], down["settled_s"]) - settled_s) <= STALE * 0.35
    overshoot = max(up["rpm_max"] - 6000.0, 3000.0 - down["rpm_min"])
    assert abs(overshoot - overshoot_rpm) <= STALE * 5.0
