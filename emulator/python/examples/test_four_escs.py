"""A test of your own, for pytest: `pytest test_four_escs.py`."""

import pytest

import siskin


@pytest.fixture
def emulator() -> siskin.Emulator:
    """Four ESCs, armed and at half throttle."""
    emulator = siskin.Emulator("bosso", escs=4, bus="6s")
    emulator.advance(0.4)
    emulator.throttle[:] = 0.5
    emulator.advance(1.6)
    return emulator


def test_all_turn_alike(emulator: siskin.Emulator) -> None:
    speeds = [esc.rpm for esc in emulator.state]
    assert max(speeds) - min(speeds) < 0.01 * max(speeds)


def test_one_that_loses_its_signal_stops_alone(emulator: siskin.Emulator) -> None:
    emulator.throttle[2] = None
    emulator.advance(2.0)
    assert [esc.armed for esc in emulator.state] == [True, True, False, True]
    assert abs(emulator.state[2].rpm) < 100.0


def test_the_pack_is_one(emulator: siskin.Emulator) -> None:
    before_v = emulator.state[0].bus_v
    emulator.throttle[:] = [1.0, 0.5, 0.5, 0.5]
    emulator.advance(0.5)
    assert len({esc.bus_v for esc in emulator.state}) == 1 and emulator.state[3].bus_v < before_v
