"""Each scenario of the repository holds what it expects."""

import pytest

from emulator import scenario
from paths import SCENARIOS

FAULTS = {
    "over-current": "over-current",
    "over-voltage": "over-voltage",
    "under-voltage": "under-voltage",
}


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENARIOS.glob("*.toml")))
def test_scenario(name):
    status, summary = scenario(SCENARIOS / f"{name}.toml")
    failed = [expected for expected in summary["expectations"] if not expected["held"]]
    assert (status, failed) == (0, [])
    assert summary["expectations"], "it expects nothing"
    wanted = FAULTS.get(name)
    if wanted is None:
        assert summary["faults"] == []
    else:
        assert len(summary["faults"]) == 1 and wanted in summary["faults"][0]
