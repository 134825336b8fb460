"""A rotor that jams in flight turns again soon after it is let go, whatever the drive was doing at that moment."""

import pytest

from emulator import scenario
from paths import SCENARIOS

JAMS_AT_S = 2.0
AGAIN_S = 0.3


@pytest.mark.parametrize("name, run_rpm", [("fault-jam", 300.0), ("fault-jam-quad", 2718.0)])
@pytest.mark.parametrize("held_s", [0.9 + 0.025 * n for n in range(9)])
def test_a_jam_of_a_second_is_over_within_three_tenths_of_a_second(name, run_rpm, held_s, tmp_path):
    text = (SCENARIOS / f"{name}.toml").read_text()
    bench = text[: text.index("[[expect]]")].replace("for_s = 1.0", f"for_s = {held_s}")
    from_s = JAMS_AT_S + held_s + AGAIN_S
    window = f'[[window]]\nname = "again"\nt0_s = {from_s}\nt1_s = {from_s + 0.3}\n'
    expected = [("rpm_min", f"above = {run_rpm}"), ("starts", "equals = 0"), ("lock_lost", "equals = 0")]
    expects = [f'[[expect]]\nwindow = "again"\nkey = "{key}"\n{bound}\n' for key, bound in expected]
    path = tmp_path / "jam.toml"
    path.write_text("\n".join([bench, window, *expects]))
    status, summary = scenario(path)
    assert (status, [each for each in summary["expectations"] if not each["held"]]) == (0, [])
    assert f"for_s = {held_s}" in bench and len(summary["expectations"]) == 3
