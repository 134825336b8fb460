"""The papers' figures, measured on the control's own code."""

import json

from emulator import run


def test_colton_stays_within_the_papers_bounds():
    ended = run("reproduce", "colton", "--json")
    assert ended.returncode == 0, ended.stderr
    items = json.loads(ended.stdout)["items"]
    assert all(set(item) == {"name", "paper", "measured", "unit", "note"} for item in items)
    names = {item["name"] for item in items}
    assert {"fig28_error_1000_to_3400", "fig28_error_500_to_7300"} <= names
    assert {"fig27_error_1000", "fig30_error_from_2000"} <= names
    beyond = [item for item in items if not 0.0 <= item["measured"] < item["paper"]]
    assert beyond == []
