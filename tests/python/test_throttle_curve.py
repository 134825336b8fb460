"""Thrust and efficiency over the throttle, as table and picture of the control's README."""

import csv
import re
import subprocess
import xml.etree.ElementTree as xml

import pytest

import readme
from emulator import run
from full_throttle import LEAST, plant_of, supply_of
from paths import ROOT, TARGET
from thrust import bench

DRAW = TARGET / "debug" / "examples" / "throttle-curve"
PICTURE = ROOT / "emulator" / "pictures" / "throttle-curve.svg"
STILL_TURNS = 0.9
"""Least share of `CTL_RPM_MIN` at the least throttle, field-oriented: the propeller and the bearings take 0.7 A, which
drop 0.056 of 1.44 V across R."""
REDRAW = "the README's table and picture are not what its commands make: make them again, and look at them"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Types the README's commands; returns what the last one prints, and the folder of the picture."""
    folder = tmp_path_factory.mktemp("curve")
    played = readme.commands("scenario", "tests/scenarios/throttle-curve.toml")
    assert len(played) == 3
    for command in played:
        ended = run(*(word.replace("target/", f"{folder}/") for word in command[command.index("--") + 1 :]))
        assert ended.returncode == 0, ended.stdout + ended.stderr
    (draw,) = readme.commands("throttle-curve")
    assert draw[draw.index("--") + 1 :] == ["target", "target"]
    ended = subprocess.run([DRAW, folder, folder], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 0, ended.stderr
    return ended.stdout, folder


def test_the_readme_has_the_table_that_its_commands_make(made):
    assert made[0] in (ROOT / "shared" / "README.md").read_text(), REDRAW


def test_the_picture_is_what_its_commands_draw(made):
    drawn = made[1] / "throttle-curve.svg"
    assert xml.parse(drawn).getroot().tag.endswith("svg")
    assert drawn.read_bytes() == PICTURE.read_bytes(), REDRAW


@pytest.mark.parametrize("drive", ["weakened", "linear"])
def test_field_oriented_the_least_throttle_turns_the_propeller_about_as_fast_as_the_least_speed(made, drive):
    """Six-step knows no such speed: what it holds at the least throttle, the scenario itself expects."""
    with (made[1] / f"{drive}.csv").open() as file:
        least, *_ = csv.DictReader(file)
    assert least["signal.1.throttle"] == "0.1"
    params = bench("quad-10-inch")["params"]
    assert float(least["steady.rpm_mean"]) >= STILL_TURNS * params["CTL_RPM_MIN"]


def test_the_best_is_that_of_the_full_throttle_s_campaign(made):
    tables = bench("quad-10-inch")
    plant = plant_of(tables["bench"]["motor"], tables["bench"]["load"], tables["params"], {})
    (told,) = re.findall(r"best possible is (\d+) rpm", (made[1] / "throttle-curve.svg").read_text())
    assert float(told) == pytest.approx(plant.best_rpm(*supply_of(tables)), rel=2e-3)


def test_thrust_rises_with_the_throttle_up_to_the_best_in_each_drive(made):
    rows = [[float(cell) for cell in line.strip("|").split("|")] for line in made[0].splitlines()[2:]]
    throttle, *columns = zip(*rows, strict=True)
    assert throttle == tuple(range(10, 101, 10))
    for thrust in columns[:3]:
        assert list(thrust) == sorted(thrust) and thrust[-1] <= 100.0
    assert columns[0][-1] >= 100 * LEAST**2
