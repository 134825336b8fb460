"""Signed frames, with pymavlink's own signing.

A ground station gives the ESC a key by SETUP_SIGNING and signs with it from then on. What it sends is recorded, so
that the same bytes can be sent again.
"""

import time

import pytest
from pymavlink import mavutil

from desk import Desk
from esc import TIMEOUT_S
from test_pymavlink import connect

KEY = bytes(range(1, 33))
OTHER = bytes(range(2, 34))
NAME = "CTL_BW_SPD_HZ"
TICKS_PER_S = 100_000
"""Timestamps count 10 µs since 2015."""


class Station:
    """pymavlink on a link of its own, recording what it sends."""

    def __init__(self, desk: Desk):
        self.master = connect(desk)
        self.sent: list[bytes] = []
        write = self.master.write

        def keep(data: bytes) -> None:
            self.sent.append(bytes(data))
            write(data)

        self.master.write = keep

    def sign(self, key: bytes, **options) -> None:
        """Signs from now on, and still accepts unsigned frames."""
        self.master.setup_signing(
            key, sign_outgoing=True, allow_unsigned_callback=lambda *_: True, **options
        )

    def give(self, key: bytes) -> None:
        """Gives the ESC a key, which it reports in a text."""
        timestamp = int((time.time() - 1_420_070_400) * TICKS_PER_S)
        self.master.mav.setup_signing_send(1, 1, list(key), timestamp)
        self.heard("STATUSTEXT", lambda m: m.text.startswith("Signing: "))

    def heard(self, kind: str, match):
        until = time.monotonic() + TIMEOUT_S
        while time.monotonic() < until:
            message = self.master.recv_match(type=kind, blocking=True, timeout=0.2)
            if message and match(message):
                return message
        raise AssertionError(f"no such {kind}")

    def set(self, value: float) -> None:
        self.master.mav.param_set_send(
            1, 1, NAME.encode(), value, mavutil.mavlink.MAV_PARAM_TYPE_REAL32
        )

    def __enter__(self) -> "Station":
        return self

    def __exit__(self, *_) -> None:
        self.master.close()


def now(desk: Desk) -> float:
    """Returns the value in the ESC, which anybody may read."""
    return desk.params()[NAME]


@pytest.fixture
def desk(start, tmp_path):
    return Desk(start, "tcp", tmp_path)


@pytest.fixture
def station(desk):
    """Yields one that has given the ESC its key, and has set 5 Hz with it."""
    with Station(desk) as station:
        station.give(KEY)
        station.sign(KEY)
        station.set(5.0)
        station.heard("PARAM_VALUE", lambda m: m.param_id == NAME and m.param_value == 5.0)
        yield station


def test_who_signs_sets_and_who_does_not_only_reads(desk, station):
    with Station(desk) as stranger:
        for sign in (None, OTHER):
            if sign:
                stranger.sign(sign)
            stranger.set(6.0)
            stranger.master.mav.setup_signing_send(1, 1, [0] * 32, 0)
            assert now(desk) == 5.0
    station.set(7.0)
    station.heard("PARAM_VALUE", lambda m: m.param_value == 7.0)
    assert now(desk) == 7.0


def test_what_leaves_the_esc_is_signed_so_that_pymavlink_believes_it(desk, station):
    for key, believes in ((KEY, True), (OTHER, False)):
        with Station(desk) as listener:
            listener.master.setup_signing(key, sign_outgoing=False)
            heartbeat = listener.master.recv_match(type="HEARTBEAT", blocking=True, timeout=2.0)
            assert (heartbeat is not None) == believes


def test_frames_are_obeyed_once_and_in_their_order(desk, station):
    station.set(6.0)
    station.heard("PARAM_VALUE", lambda m: m.param_value == 6.0)
    five, six = [frame for frame in station.sent if NAME.encode() in frame][-2:]
    for again in (five, six):
        station.master.write(again)
        assert now(desk) == 6.0
    # With the key, on another link, but from two minutes ago.
    with Station(desk) as late:
        ago = int((time.time() - 120 - 1_420_070_400) * TICKS_PER_S)
        late.sign(KEY, initial_timestamp=ago, link_id=9)
        late.set(9.0)
        assert now(desk) == 6.0


def test_neither_the_key_nor_what_was_heard_is_forgotten_without_power(desk, station):
    replayed = [frame for frame in station.sent if NAME.encode() in frame][-1]
    station.set(8.0)
    station.heard("PARAM_VALUE", lambda m: m.param_value == 8.0)
    desk.power_cycle()
    assert now(desk) == 8.0
    with Station(desk) as stranger:
        stranger.master.write(replayed)
        stranger.set(6.0)
        assert now(desk) == 8.0
    with Station(desk) as again:
        again.sign(KEY)
        again.set(6.5)
        again.heard("PARAM_VALUE", lambda m: m.param_value == 6.5)
        # Whoever has the key can take it away.
        again.give(bytes(32))
    with Station(desk) as anybody:
        anybody.set(7.5)
        anybody.heard("PARAM_VALUE", lambda m: m.param_value == 7.5)
