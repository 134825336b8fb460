"""What a pilot feels, with the flashed image on the virtual board: a start, full throttle, wind, a sag.

The same bounds hold in the emulator, whose speeds the image's are compared with.
"""

from dataclasses import dataclass

import pytest
from board import on_board
from emulator import scenario, windows_of
from motors import written
from slams import IDLE, SPEED, VOLTAGE

OPENS_S = 0.4
"""The image has booted and listened to the wire."""


@dataclass
class Flight:
    tables: dict
    throttle: list
    windows: dict
    faults: tuple = ()
    forwards: tuple = ()
    """Windows in which the motor turns forwards, faster than a speed in rpm."""
    bus_v: tuple = ()
    """Windows in which the supply's mean voltage is above a least one."""
    alike: tuple = ("end",)
    """Windows in which the mean speed is the emulator's."""


BENCH = {"base": "quad-10-inch", "plant": "switching", "dead_time_ns": 750.0, "wire": "bidirectional-dshot600"}
"""Its limits suit the board, whose least dead time this is."""
PARAMS = {"CTL_MODE": VOLTAGE, "CTL_RPM_MAX": 10_500, "CTL_SLEW_RPM_S": 0, "PWM_DEADTIME_NS": 750}
"""In voltage mode the throttle's scale is what the board's sampling leaves of the supply; speeds are the same in speed
mode, up to one that is out of reach."""
EMPTY = {"cells": 4, "capacity_ah": 4.0, "charge": 0.15, "resistance_mohm": 120}
HALF_WIND = {"at_s": 0.8, "kind": "gust", "value": -4000.0}
"""Two thirds of the speed at half throttle."""

FLIGHTS = {
    # 80 % of what it idles at within 0.2 s, and 0.97 of what its pack and limits allow.
    "a start, full throttle and idle": Flight(
        {"bench": BENCH | {"duration_s": 3.0}, "params": PARAMS},
        [(0.0, 0.0), (OPENS_S, IDLE), (1.0, 1.0), (2.0, IDLE)],
        {"started": (OPENS_S + 0.2, 1.0), "full": (1.9, 2.0), "end": (2.9, 3.0)},
        forwards=(("started", 400), ("full", 9000), ("end", 400)),
        alike=("full", "end"),
    ),
    # The pack would fall far below LIM_BUS_V_MIN.
    "full throttle on an empty pack": Flight(
        {
            "bench": BENCH | {"duration_s": 2.6},
            "bench.bus": EMPTY,
            "params": PARAMS | {"CTL_MODE": SPEED, "LIM_BUS_V_MIN": 13},
        },
        [(0.0, 0.0), (OPENS_S, 0.3), (1.2, 1.0), (2.0, 0.3)],
        {"full": (1.6, 2.0), "end": (2.5, 2.6)},
        forwards=(("full", 4000), ("end", 2000)),
        bus_v=(("full", 13.0),),
    ),
    # It turns backwards when the throttle opens again, and forwards half a second later.
    "throttle in a wind from below": Flight(
        {"bench": BENCH | {"duration_s": 2.8}, "params": PARAMS | {"CTL_MODE": SPEED, "MOT_STOP": 0}},
        [(0.0, 0.0), (OPENS_S, 0.5), (1.0, 0.0), (2.0, 0.5)],
        {"cut": (1.95, 2.0), "forwards": (2.5, 2.8), "end": (2.7, 2.8)},
        faults=(HALF_WIND,),
        forwards=(("forwards", 0),),
    ),
}


def played(flight: Flight, play, folder) -> dict:
    """Plays a flight; returns its windows by name once all of its bounds hold."""
    summary = play(written(folder, flight.tables, flight.throttle, flight.windows, flight.faults))
    seen = windows_of(summary)
    # The virtual board sees the shaft and the supply, not the faults: those would be seen in the speeds.
    assert summary.get("faults") in ([], None)
    for window, rpm in flight.forwards:
        assert seen[window]["rpm_min"] > rpm, (window, seen[window]["rpm_min"])
    for window, volts in flight.bus_v:
        assert seen[window]["bus_v_mean"] > volts, (window, seen[window]["bus_v_mean"])
    return seen


@pytest.mark.parametrize("name", FLIGHTS)
def test_the_image_flies_like_the_emulator(name, tmp_path):
    flight = FLIGHTS[name]
    board = played(flight, on_board, tmp_path)
    emulator = played(flight, lambda path: scenario(path)[1], tmp_path)
    for window in flight.alike:
        assert board[window]["rpm_mean"] == pytest.approx(emulator[window]["rpm_mean"], rel=0.02), window
