"""Fixtures of the tests with real ground tools."""

import pytest

from desk import WAYS, Desk
from lossy import Lossy


@pytest.fixture(params=WAYS)
def desk(request, start, tmp_path) -> Desk:
    """An ESC reached by UDP, by TCP, or by a serial line at 115200 baud."""
    return Desk(start, request.param, tmp_path)


@pytest.fixture
def slow_desk(start, tmp_path) -> Desk:
    """An ESC on a serial line at 57600 baud."""
    return Desk(start, "pty", tmp_path, baud=57_600)


@pytest.fixture
def peripheral_desk(start, tmp_path) -> Desk:
    """An ESC as a flight controller's peripheral, component 140, without the flight controller."""
    return Desk(start, "udp", tmp_path, "--param", "MAV_ROLE=1")


@pytest.fixture
def lossy_desk(start, tmp_path):
    """An ESC behind a path that loses, doubles and delays a fifth of all packets in both directions."""
    desk = Desk(start, "udp", tmp_path)
    with Lossy(desk.port, seed=1) as path:
        desk.port = path.port
        yield desk
