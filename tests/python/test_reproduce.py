"""The papers' figures, measured on the control's own code."""

import json

import pytest

import readme
from emulator import run
from paths import ROOT

# What was published, and within what bound the simulation must show it.
BOSSO = {
    "copper_loss_ratio": (1.0966, 1e-4),
    "efficiency_diff_3000": (3.65, 0.8),
    "efficiency_diff_4500": (1.49, 0.25),
    "efficiency_diff_6000": (0.54, 0.15),
    "ripple_foc_4500": (32.7, 3.0),
    "ripple_six_step_4500": (54.4, 1.5),
    "table3_k_p": (1178.0, 12.0),
    "table3_k_i": (340.0, 3.0),
    "table3_observer_re": (-2360.0, 24.0),
    "table3_attitude_im": (429.0, 5.0),
}


PICTURES = ROOT / "emulator" / "pictures"

REDRAW = "the README's picture is not what its commands draw: draw it again by them, and look at it"


def assert_compared(items: list[dict]) -> None:
    """Asserts that each item has a verdict that follows from its bound, and a reason."""
    for item in items:
        assert {"name", "paper", "measured", "unit", "note", "verdict", "bound", "reason"} == set(item)
        assert item["reason"], item
        if item["paper"] is None:
            assert (item["verdict"], item["bound"]) == ("open", None), item
            continue
        low, high = item["bound"]
        within = low <= item["measured"] <= high
        assert item["verdict"] == ("agrees" if within else "differs"), item


def reproduce(paper: str, folder: object) -> list[str]:
    """Returns the README's command for a paper, drawing into this folder."""
    (command,) = readme.commands("reproduce", paper)
    words = command[command.index("--") + 1 :]
    return [word.replace(f"target/{paper}", str(folder)) for word in words]


def test_the_first_spin_is_the_one_in_the_readme(tmp_path):
    commands = readme.commands("scenario", "target/first-spin.csv") + readme.commands("--", "plot")
    assert [command[command.index("--") + 1] for command in commands] == ["scenario", "plot"]
    for command in commands:
        words = [word.replace("target/", f"{tmp_path}/") for word in command[command.index("--") + 1 :]]
        words = [word.replace("emulator/pictures/", f"{tmp_path}/") for word in words]
        ended = run(*words)
        assert ended.returncode == 0, ended.stderr
    drawn = (tmp_path / "first-spin.svg").read_bytes()
    assert drawn == (PICTURES / "first-spin.svg").read_bytes(), REDRAW


def test_bosso_shows_what_the_paper_printed(tmp_path):
    ended = run(*reproduce("bosso", tmp_path), "--json")
    assert ended.returncode == 0, ended.stderr
    items = json.loads(ended.stdout)["items"]
    assert_compared(items)
    items = {item["name"]: item for item in items}
    assert items["fig7_efficiency_diff_3000"]["verdict"] == "differs", "it has the other sign"
    assert items["efficiency_diff_3000"]["verdict"] == "agrees"
    assert (tmp_path / "bosso-4.svg").read_bytes() == (PICTURES / "bosso-4.svg").read_bytes(), REDRAW
    assert all(item["measured"] is not None for item in items.values())
    for name, (paper, within) in BOSSO.items():
        assert items[name]["paper"] == pytest.approx(paper, abs=1e-4), name
        assert items[name]["measured"] == pytest.approx(paper, abs=within), name
    foc, space_vector = items["ripple_foc_4500"], items["ripple_foc_4500_space_vector"]
    assert space_vector["measured"] < foc["measured"]
    differences = [items[f"efficiency_diff_{rpm}"]["measured"] for rpm in (3000, 4500, 6000)]
    assert differences == sorted(differences, reverse=True)
    for rpm in (3000, 4500, 6000):
        assert abs(items[f"angle_error_{rpm}"]["measured"]) < 1.0
    pictures = {path.name for path in tmp_path.iterdir()}
    numbers = (3, 4, 7, 8, 9)
    assert pictures == {f"bosso-{n}.{end}" for n in numbers for end in ("png", "svg")}


def test_colton_stays_within_the_papers_bounds(tmp_path):
    ended = run(*reproduce("colton", tmp_path), "--json")
    assert ended.returncode == 0, ended.stderr
    items = json.loads(ended.stdout)["items"]
    assert_compared(items)
    names = {item["name"] for item in items}
    assert {"fig28_error_1000_to_3400", "fig28_error_500_to_7300"} <= names
    assert {"fig27_error_1000", "fig30_error_from_2000"} <= names
    parts = {name.split("_")[0] for name in names}
    assert {"fig19", "fig20", "fig21", "fig42", "fig43", "fig50", "fig52", "fig54", "table1"} <= parts
    bounded = [item for item in items if item["name"].split("_")[0] in {"fig27", "fig28", "fig30"}]
    beyond = [item for item in bounded if not 0.0 <= item["measured"] < item["paper"]]
    assert beyond == []
