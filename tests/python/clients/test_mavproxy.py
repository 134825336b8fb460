"""MAVProxy with its default modules, as its command line starts it, but without windows.

That a name is unknown only shows in the list: `param fetch` of one hears the ESC's PARAM_ERROR and prints nothing. A
refused value is sent three times, and then reported with the value in force.
"""

import time

from desk import Desk
from station import MavProxy

LISTED = r"Received \d+ parameters"
LISTED_BY_FTP = LISTED + r" \(ftp\)"


def test_lists_sets_saves_loads_and_finds_again(desk, tmp_path):
    file = tmp_path / "esc.parm"
    with MavProxy(desk, tmp_path / "first") as station:
        values = station.listed()
        assert values == desk.params()
        station.set("CTL_RPM_MAX", 5432.5)
        station.ask(f"param save {file}", f"Saved {len(values)} parameters to")
        saved = file.read_text()
        file.write_text(saved.replace("CTL_RPM_MIN      300.0", "CTL_RPM_MIN      250.5"))
        station.ask(f"param load {file}", r"changed CTL_RPM_MIN from 300.0+ to 250.50+")
        assert station.wait_value("CTL_RPM_MIN", 250.5)
    changed = {**values, "CTL_RPM_MAX": 5432.5, "CTL_RPM_MIN": 250.5}
    assert desk.params() == changed
    desk.power_cycle()
    with MavProxy(desk, tmp_path / "second") as station:
        station.listed()
        station.ask("param fetch", LISTED)
        assert station.listed() == changed


def test_an_unknown_name_and_a_refused_value_are_told(start, tmp_path):
    desk = Desk(start, "tcp", tmp_path)
    with MavProxy(desk, tmp_path / "station") as station:
        station.listed()
        station.ask("param set NO_SUCH_NAME 1", "Unable to find parameter 'NO_SUCH_NAME'")
        station.ask("param set MOT_KV 400", r"MOT_KV refused: read-only")
        station.wait(r"Failed to set MOT_KV to 400 \(invalid returned value 353")


def test_a_peripheral_is_reached_as_component_140(peripheral_desk, tmp_path):
    with MavProxy(peripheral_desk, tmp_path / "station") as station:
        # On a vehicle, the system is the flight controller's.
        station.say("set target_system 1")
        station.say("set target_component 140")
        values = station.listed()
        assert values == peripheral_desk.params()
        station.set("CTL_RPM_MAX", 5432.5)
    assert peripheral_desk.params() == {**values, "CTL_RPM_MAX": 5432.5}


def test_a_lossy_path_ends_with_the_full_list_and_the_set_value(lossy_desk, tmp_path):
    with MavProxy(lossy_desk, tmp_path / "station") as station:
        values = station.listed(timeout=30.0)
        assert values == lossy_desk.params()
        station.set("CTL_RPM_MAX", 5432.5)
    assert lossy_desk.params() == {**values, "CTL_RPM_MAX": 5432.5}


def test_a_list_takes_3_s_at_57600_baud(slow_desk, tmp_path):
    with MavProxy(slow_desk, tmp_path / "station") as station:
        station.listed()
        station.say("set param_ftp False")
        begin = time.monotonic()
        station.ask("param fetch", LISTED)
        seconds = time.monotonic() - begin
        values = station.listed()
    assert values == slow_desk.params()
    assert seconds <= 3.0


def test_ftp_has_the_same_list_and_its_defaults(desk, tmp_path):
    with MavProxy(desk, tmp_path / "station") as station:
        station.listed()
        station.set("CTL_RPM_MAX", 5432.5)
        station.ask("param ftp", LISTED_BY_FTP)
        assert station.listed() == desk.params()
        station.ask("param diff", r"^CTL_RPM_MAX +5432.50+ 6000.0+$")


def test_ftp_takes_1_s_at_57600_baud(slow_desk, tmp_path):
    with MavProxy(slow_desk, tmp_path / "station") as station:
        station.listed()
        begin = time.monotonic()
        station.ask("param ftp", LISTED_BY_FTP)
        seconds = time.monotonic() - begin
        values = station.listed()
    assert values == slow_desk.params()
    assert seconds <= 1.0
