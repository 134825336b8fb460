"""MAVSDK, through its Python wheel's blocking calls.

A component beside an autopilot can be selected, but this version of the wheel reports a failure when there was none.
"""

import json
import threading
import time
from contextlib import contextmanager, suppress

import pytest
from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.component_metadata.component_metadata import ComponentMetadata, MetadataType
from mavsdk.plugins.param.param import Param, ParamError, ParamResult

import siskin_dialect as dialect
from desk import Desk
from emulator import OF_BENCH
from esc import TIMEOUT_S


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """Gives MAVSDK a home folder, in which it keeps a cache."""
    monkeypatch.setenv("HOME", str(tmp_path))


@contextmanager
def connect(desk: Desk):
    """Yields the ESC that it finds."""
    station = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        station.add_any_connection_with_handle(desk.mavsdk)
        esc = station.first_autopilot(TIMEOUT_S)
        assert esc is not None, "no ESC found"
        yield esc
    finally:
        station.destroy()


def fetch(params: Param) -> dict[str, float]:
    everything = params.get_all_params()
    assert not everything.int_params and not everything.custom_params, "all are floats"
    return {param.name: param.value for param in everything.float_params}


def test_lists_sets_and_finds_again(desk):
    with connect(desk) as esc:
        params = Param(esc)
        values = fetch(params)
        assert values == desk.params()
        params.set_param_float("CTL_RPM_MAX", 5432.5)
        assert params.get_param_float("CTL_RPM_MAX") == 5432.5
    desk.power_cycle()
    with connect(desk) as esc:
        params = Param(esc)
        assert fetch(params) == {**values, "CTL_RPM_MAX": 5432.5}


def test_what_is_missing_or_refused_is_an_error(desk):
    with connect(desk) as esc:
        params = Param(esc)
        refused = [
            (ParamResult.DOES_NOT_EXIST, params.get_param_float, ("NO_SUCH_NAME",)),
            (ParamResult.DOES_NOT_EXIST, params.set_param_float, ("NO_SUCH_NAME", 1.0)),
            (ParamResult.WRONG_TYPE, params.get_param_int, ("CTL_MODE",)),
            (ParamResult.READ_ONLY, params.set_param_float, ("MOT_KV", 400.0)),
            (ParamResult.VALUE_OUT_OF_RANGE, params.set_param_float, ("CTL_MODE", 9.0)),
        ]
        for result, call, arguments in refused:
            with pytest.raises(ParamError) as error:
                call(*arguments)
            assert error.value.result == result, arguments


def test_a_lossy_path_ends_with_the_full_list_and_the_set_value(lossy_desk):
    with connect(lossy_desk) as esc:
        params = Param(esc)
        values = fetch(params)
        assert values == lossy_desk.params()
        for _ in range(5):
            # Once in a hundred times, all six tries are lost.
            with suppress(ParamError):
                params.set_param_float("CTL_RPM_MAX", 5432.5)
                break
        assert fetch(params) == {**values, "CTL_RPM_MAX": 5432.5}


def test_a_list_takes_3_s_at_57600_baud(slow_desk):
    with connect(slow_desk) as esc:
        params = Param(esc)
        begin = time.monotonic()
        values = fetch(params)
        seconds = time.monotonic() - begin
    assert values == slow_desk.params()
    assert seconds <= 3.0


def test_ftp_has_what_describes_the_parameters(desk):
    with connect(desk) as esc:
        values = fetch(Param(esc))
        metadata, done = ComponentMetadata(esc), threading.Event()

        def told(update, _) -> None:
            if update.type == MetadataType.ALL_COMPLETED:
                done.set()

        metadata.subscribe_metadata_available(told)
        metadata.request_autopilot_component()
        assert done.wait(TIMEOUT_S)
        found = metadata.get_metadata(dialect.MAV_COMP_ID_AUTOPILOT1, MetadataType.PARAMETER)
    described = {param["name"]: param for param in json.loads(found.json_metadata)["parameters"]}
    assert set(described) == set(values)
    assert all(param["shortDesc"] for param in described.values())
    defaults = {name: param["default"] for name, param in described.items() if "default" in param}
    # Derived parameters have none.
    assert set(values) - set(defaults) == {"MOT_KV"}
    # These are the factory's.
    values.update(dict.fromkeys(OF_BENCH, 0))
    assert defaults == pytest.approx({name: values[name] for name in defaults}, rel=1e-6)
