"""The Siskin brushless ESC in Python: its own control code on simulated motors, in this process and without sockets.

Four ESCs on one pack, armed and at half throttle::

    import siskin

    emulator = siskin.Emulator("quad-5-inch", escs=4)
    emulator.advance(0.5)                  # zero throttle arms
    emulator.throttle[:] = 0.5
    emulator.advance(1.0)
    print([round(esc.rpm) for esc in emulator.state])

A scenario, and a sweep of one over many seeds on all cores::

    outcome = siskin.scenario("tests/scenarios/steps.toml")
    table = siskin.sweep("tests/scenarios/random-drives.toml", seeds=range(1, 61))
    table.to_csv("drives.csv")

Contents:

:class:`Emulator`
    One to eight ESCs on one clock, one supply and one MAVLink stream. Simulated time advances only by
    :meth:`Emulator.advance`, and equal calls give equal bits, on any machine and at any pace.
:func:`scenario`
    Plays a scenario, as ``siskin-emulator scenario`` does.
:func:`sweep`
    Plays all runs of a scenario on all cores, or on a Dask cluster, and returns a :class:`Table` of them.
:exc:`Error`
    Any error, in one line, with the text that the program prints.
:data:`BENCHES`, :data:`PARAMETERS`
    The names of the built-in benches and of the ESC's parameters.

The last part of a name is its unit: ``bus_v`` is in volts, ``torque_nm`` in newton metres. The emulator's guide
describes benches, scenarios and faults; the guide in ``emulator/python`` has recipes, including Dask clusters.
"""

from ._emulator import Emulator, Throttle
from ._faults import Faults
from ._mavlink import MavlinkPipe
from ._params import Params
from ._record import dtype
from ._scenario import Outcome, scenario
from ._siskin import BENCHES, PARAMETERS, PHASES, Error, EscState, Reply, Reported, __version__
from ._sweep import Cell, Table, sweep

__all__ = [
    "BENCHES",
    "PARAMETERS",
    "PHASES",
    "Cell",
    "Emulator",
    "Error",
    "EscState",
    "Faults",
    "MavlinkPipe",
    "Outcome",
    "Params",
    "Reply",
    "Reported",
    "Table",
    "Throttle",
    "__version__",
    "dtype",
    "scenario",
    "sweep",
]
