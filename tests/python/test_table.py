"""The table of a scenario's runs."""

import csv
import json
import os
import subprocess

import pytest

from emulator import run
from paths import PROGRAM

SWEEP = """
[bench]
duration_s = 0.6

[sweep]
"params.MOT_R_MOHM" = [75.6, 108.0]
"bench.load" = ["none", "cfprop-13x4.4"]

[random]
"bench.initial_angle_deg" = [-180.0, 180.0]

[[signal]]
at_s = 0.1
rpm = 3000.0

[[window]]
name = "end"
t0_s = 0.5
t1_s = 0.6

[[expect]]
window = "end"
key = "rpm_mean"
above = 2000.0
"""


@pytest.fixture
def sweep(tmp_path):
    path = tmp_path / "sweep.toml"
    path.write_text(SWEEP)
    return path


def table(scenario, path, threads: int) -> tuple[dict, list[dict]]:
    command = [PROGRAM, "scenario", scenario, "--seeds", "3..5", "--table", path, "--json"]
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
    assert ended.returncode in (0, 1), ended.stderr
    with path.open(newline="") as file:
        return json.loads(ended.stdout), list(csv.DictReader(file))


def test_each_run_has_a_row_whatever_ran_beside_it(sweep, tmp_path):
    summary, rows = table(sweep, tmp_path / "one.csv", 1)
    table(sweep, tmp_path / "many.csv", 3)
    assert (tmp_path / "one.csv").read_bytes() == (tmp_path / "many.csv").read_bytes()
    assert len(rows) == summary["runs"] == 12
    keys = {(row["seed"], row["params.MOT_R_MOHM"], row["bench.load"]) for row in rows}
    assert len(keys) == 12 and {key[0] for key in keys} == {"3", "4", "5"}
    # What a seed draws is its own, and the same for everything it plays.
    assert len({(row["seed"], row["bench.initial_angle_deg"]) for row in rows}) == 3
    assert sum(row["held"] == "false" for row in rows) == summary["failed"]
    for row in rows:
        assert (row["end.rpm_mean above 2000"] == "true") == (float(row["end.rpm_mean"]) > 2000.0) == (row["held"] == "true")
    assert min(float(row["end.rpm_mean"]) for row in rows) == summary["expectations"][0]["worst"]


def test_a_row_is_what_the_run_alone_gives(sweep, tmp_path):
    _, rows = table(sweep, tmp_path / "all.csv", 2)
    wanted = next(row for row in rows if row["seed"] == "4" and row["bench.load"] == "none" and row["params.MOT_R_MOHM"] == "108")
    options = ("--seed", 4, "--set", "bench.load=none", "--set", "params.MOT_R_MOHM=108.0")
    ended = run("scenario", sweep, *options, "--table", tmp_path / "alone.csv")
    assert ended.returncode in (0, 1), ended.stderr
    with (tmp_path / "alone.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row == wanted


@pytest.mark.parametrize("name, words", [("table.txt", ".csv or .parquet"), ("no/table.csv", "no/table.csv")])
def test_a_table_that_cannot_be_is_said_before_anything_is_played(sweep, tmp_path, name, words):
    ended = run("scenario", sweep, "--table", tmp_path / name)
    assert ended.returncode == 2 and words in ended.stderr and ended.stderr.count("\n") == 1, ended.stderr
    assert ended.stdout == ""
