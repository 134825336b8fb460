"""pymavlink, the wheel alone, as used by a person's script.

Its `mavparm` sets, saves and loads, but does not list: a script requests the list, and what is missing by index.
`mavset` takes any PARAM_VALUE with that name for its answer, so a late one from a list passes too: over a lossy path a
script checks again. A refused value passes likewise; the ESC's PARAM_ERROR says why.
"""

import time
from contextlib import closing

import pytest
from pymavlink import mavftp, mavparm, mavutil

from desk import Desk
from emulator import OF_BENCH
from esc import TIMEOUT_S


def connect(desk: Desk):
    """Returns a connection that knows its ESC."""
    master = mavutil.mavlink_connection(desk.pymavlink, baud=desk.baud, dialect="ardupilotmega")
    until = time.monotonic() + TIMEOUT_S
    while time.monotonic() < until:
        # By UDP the ESC answers whoever has called.
        master.mav.heartbeat_send(
            mavutil.mavlink.MAV_TYPE_GCS, mavutil.mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0
        )
        if master.wait_heartbeat(timeout=0.5) is not None:
            return master
    raise AssertionError("no heartbeat")


def fetch(master, timeout: float = TIMEOUT_S) -> mavparm.MAVParmDict:
    """Returns the whole list, requested again, and then by index, if a packet was lost."""
    values, count = {}, 0
    until = time.monotonic() + timeout
    master.param_fetch_all()
    while not count or len(values) < count:
        assert time.monotonic() < until, f"{len(values)} of {count} parameters"
        told = master.recv_match(type="PARAM_VALUE", blocking=True, timeout=0.4)
        if told:
            count = told.param_count
            values[told.param_index] = told.param_id, told.param_value
        elif not count:
            master.param_fetch_all()
        else:
            for index in set(range(count)) - set(values):
                master.param_fetch_one(index)
    params = mavparm.MAVParmDict()
    params.update(values[index] for index in sorted(values))
    return params


def download(master) -> mavftp.ParamData:
    """Returns the parameters and their defaults, read as one file by MAVLink FTP."""
    files: list[bytes] = []
    ftp = mavftp.MAVFTP(master, master.target_system, master.target_component)
    ftp.cmd_get(["@PARAM/param.pck?withdefaults=1"], callback=lambda file: files.append(file.read()))
    result = ftp.process_ftp_reply("OpenFileRO", timeout=30.0)
    assert result.error_code == mavftp.FtpError.Success, result.error_code
    params = mavftp.MAVFTP.ftp_param_decode(files[0])
    assert params is not None, "not the format"
    return params


def named(entries: list) -> dict[str, float]:
    return {name.decode(): value for name, value, _ in entries}


def test_lists_sets_saves_loads_and_finds_again(desk, tmp_path):
    file = tmp_path / "esc.parm"
    with closing(connect(desk)) as master:
        params = fetch(master)
        assert params == desk.params()
        assert params.mavset(master, "CTL_RPM_MAX", 5432.5)
        params.save(file)
        file.write_text(file.read_text().replace("CTL_RPM_MIN      300.0", "CTL_RPM_MIN      250.5"))
        assert params.load(file, mav=master)
    changed = {"CTL_RPM_MAX": 5432.5, "CTL_RPM_MIN": 250.5}
    assert desk.params() == {**params, **changed}
    desk.power_cycle()
    with closing(connect(desk)) as master:
        assert fetch(master) == {**params, **changed}


def test_an_unknown_name_and_a_refused_value_are_told(desk):
    with closing(connect(desk)) as master:
        master.param_fetch_one("NO_SUCH_NAME")
        error = master.recv_match(type="PARAM_ERROR", blocking=True, timeout=TIMEOUT_S)
        assert error.param_id == "NO_SUCH_NAME"
        assert error.error == mavutil.mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
        master.param_set_send("MOT_KV", 400.0)
        error = master.recv_match(type="PARAM_ERROR", blocking=True, timeout=TIMEOUT_S)
        assert error.param_id == "MOT_KV"
        assert error.error == mavutil.mavlink.MAV_PARAM_ERROR_READ_ONLY


def test_a_peripheral_answers_who_asks_nobody_in_particular(peripheral_desk):
    with closing(connect(peripheral_desk)) as master:
        # It takes no target from the heartbeat of a component without an autopilot.
        assert (master.target_system, master.target_component) == (0, 0)
        params = fetch(master)
        assert params == peripheral_desk.params()
        assert params.mavset(master, "CTL_RPM_MAX", 5432.5)
        assert named(download(master).params) == {**params, "CTL_RPM_MAX": 5432.5}


def test_a_lossy_path_ends_with_the_full_list_and_the_set_value(lossy_desk):
    with closing(connect(lossy_desk)) as master:
        params = fetch(master, timeout=30.0)
        assert params == lossy_desk.params()
        changed = {**params, "CTL_RPM_MAX": 5432.5}
        for _ in range(5):
            params.mavset(master, "CTL_RPM_MAX", 5432.5)
            if fetch(master, timeout=30.0) == changed:
                break
        assert lossy_desk.params() == changed


def test_a_list_takes_3_s_at_57600_baud(slow_desk):
    with closing(connect(slow_desk)) as master:
        begin = time.monotonic()
        params = fetch(master)
        seconds = time.monotonic() - begin
    assert params == slow_desk.params()
    assert seconds <= 3.0


def test_ftp_has_the_same_list_and_its_defaults(desk):
    with closing(connect(desk)) as master:
        defaults = desk.params()
        params = mavparm.MAVParmDict()
        assert params.mavset(master, "CTL_RPM_MAX", 5432.5)
        file = download(master)
    assert named(file.params) == {**defaults, "CTL_RPM_MAX": 5432.5}
    # These are the factory's.
    assert named(file.defaults) == {**defaults, **dict.fromkeys([*OF_BENCH, "MOT_KV"], 0)}


def test_ftp_brings_the_full_list_over_a_lossy_path(lossy_desk):
    with closing(connect(lossy_desk)) as master:
        assert named(download(master).params) == lossy_desk.params()


def test_ftp_takes_1_s_at_57600_baud(slow_desk):
    with closing(connect(slow_desk)) as master:
        begin = time.monotonic()
        file = download(master)
        seconds = time.monotonic() - begin
    assert named(file.params) == slow_desk.params()
    assert seconds <= 1.0
