"""ESCs that run as a program says."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, overload

import numpy as np

from . import _index, _record
from ._faults import Faults
from ._index import Values
from ._mavlink import MavlinkPipe
from ._params import Params
from ._scenario import scenario
from ._siskin import Error, EscState, Laboratory
from ._sweep import sweep


class Throttle(Sequence["float | None"]):
    """The throttle of each ESC, from 0 to 1, as a flight controller sends it: a frame a millisecond.

    0 is motor stop, and arms once it has been held for 300 ms. ``None`` is a silent wire, which the ESC takes for a
    lost signal. ``throttle[i] = 0.5`` is for one ESC, ``throttle[:] = 0.5`` for all, and
    ``throttle[:] = [0.5, 0.4, 0.5, 0.4]`` for each in turn. A value counts from the next frame on.
    """

    def __init__(self, laboratory: Laboratory) -> None:
        self._laboratory = laboratory

    def __len__(self) -> int:
        return self._laboratory.escs

    @overload
    def __getitem__(self, esc: int) -> float | None: ...
    @overload
    def __getitem__(self, esc: slice) -> list[float | None]: ...
    def __getitem__(self, esc: int | slice) -> float | None | list[float | None]:
        if isinstance(esc, slice):
            return [self._laboratory.throttle(index) for index in range(len(self))[esc]]
        return self._laboratory.throttle(_index.one(len(self), esc))

    @overload
    def __setitem__(self, esc: int, throttle: float | None) -> None: ...
    @overload
    def __setitem__(self, esc: slice, throttle: Values) -> None: ...
    def __setitem__(self, esc: int | slice, throttle: Values) -> None:
        escs = range(len(self))[esc] if isinstance(esc, slice) else [_index.one(len(self), esc)]
        for index, value in zip(escs, _index.each("throttle", len(escs), throttle), strict=True):
            self._laboratory.set_throttle(index, value)

    def __iter__(self) -> Iterator[float | None]:
        return iter(self[:])

    def __repr__(self) -> str:
        return f"Throttle({self[:]})"


class Emulator:
    """One to eight ESCs with their motors, on one clock, one supply and one MAVLink stream.

    Simulated time goes on only by :meth:`advance`. What comes out depends on the calls and the simulated times at
    which they come, bit for bit, and not on how time is cut into calls. Several threads may use it, one after the
    other; what takes long lets Python's other threads run.

    :param bench: a built-in bench (:data:`siskin.BENCHES`) or the path of a file like one: motor, load, supply, and the
        parameters that the ESCs need for them.
    :param escs: how many, 1 to 8. Of several each is a peripheral on MAVLink, component 140 and on.
    :param seed: of all randomness.
    :param params: parameters over the bench's, by name. They are not stored.
    :param wire: how throttle is sent, as a scenario's ``bench.wire`` has it: ``"dshot600"``, ``"servo"``...
    :param storage: the file behind the flash, ``PATH.i`` where there are several ESCs; it is this emulator's alone as
        long as that lives. Without one nothing is kept.
    :param record: whether each control period is kept for :meth:`record`.
    :param trace: whether the control's state is hashed for :attr:`trace_hashes`.
    :param keys: other keys of a scenario's ``[bench]``, as ``bus="6s"``, ``load="none"`` or ``plant="switching"``.
    :raises siskin.Error: if something cannot stand on the bench, with what would do.
    """

    def __init__(
        self,
        bench: str | os.PathLike[str] = "bosso",
        escs: int = 4,
        seed: int = 1,
        *,
        params: Mapping[str, float] | None = None,
        wire: str = "bidirectional-dshot600",
        storage: str | os.PathLike[str] | None = None,
        record: bool = False,
        trace: bool = False,
        **keys: Any,
    ) -> None:
        given = {**keys, "seed": seed}
        listed = list((params or {}).items())
        self._laboratory = Laboratory(os.fspath(bench), escs, given, wire, listed, storage, record, trace)
        for warning in self._laboratory.warnings:
            warnings.warn(warning, stacklevel=2)
        self._throttle = Throttle(self._laboratory)
        self._params = Params(self._laboratory)
        self._mavlink = MavlinkPipe(self._laboratory)
        self._faults = Faults(self._laboratory)

    def advance(self, seconds: float) -> None:
        """Lets simulated time go on.

        :param seconds: for how long, to the nanosecond.
        :raises siskin.Error: if that is no time, or the simulated motor has left all bounds.
        """
        self._laboratory.advance(seconds)

    @property
    def time_s(self) -> float:
        """Simulated time since the start, s."""
        return self._laboratory.now_ns / 1e9

    @property
    def state(self) -> list[EscState]:
        """Each ESC and its motor as they are now, with what it has answered in the latest advance."""
        return self._laboratory.states()

    @property
    def throttle(self) -> Throttle:
        """The throttle of each ESC, to be read and set."""
        return self._throttle

    @throttle.setter
    def throttle(self, throttle: Values) -> None:
        self._throttle[:] = throttle

    def send(self, esc: int, datagram: bytes, after_s: float = 0.0) -> None:
        """Plays a frame on an ESC's wire that a program has made itself; set its :attr:`throttle` to ``None`` first.

        :param datagram: as over UDP, described in the emulator's guide under "The throttle wire over UDP".
        :param after_s: when its first edge comes, s from now. One that still plays is waited for.
        :raises siskin.Error: if it is malformed, or more than 100 ms wait.
        """
        self._laboratory.send(_index.one(self._laboratory.escs, esc), datagram, after_s)

    def environment(
        self,
        *,
        supply_v: float | None = None,
        supply_ohm: float | None = None,
        ambient_c: float | None = None,
        torque_nm: Values = None,
        wind_rpm: Values = None,
    ) -> None:
        """Changes what is around the ESCs from now on. What is left out, or ``None``, stays as it is.

        :param supply_v: voltage of the supply without load, V, 0 to 100: in place of a battery's, which then is never
            empty.
        :param supply_ohm: resistance of the supply, Ω, 0 to 100.
        :param ambient_c: temperature of the air, °C, -60 to 150.
        :param torque_nm: torque on the shaft beside its load's, Nm, ±100, for all ESCs or for each; positive turns it
            with the phases in the order a, b, c.
        :param wind_rpm: air speed, as the speed at which it would turn the propeller by itself, rpm, ±100 000, likewise.
        :raises siskin.Error: if one is out of its range; nothing has changed then.
        """
        escs = self._laboratory.escs
        torques = _index.each("torque_nm", escs, torque_nm)
        winds = _index.each("wind_rpm", escs, wind_rpm)
        self._laboratory.environment(supply_v, supply_ohm, ambient_c, torques, winds)

    @property
    def params(self) -> Params:
        """The parameters of all ESCs, by name, to be read and set."""
        return self._params

    @property
    def mavlink(self) -> MavlinkPipe:
        """The MAVLink stream of all ESCs, as a pipe of bytes."""
        return self._mavlink

    @property
    def faults(self) -> Faults:
        """What is broken, to be looked at, added to and mended."""
        return self._faults

    def record(self, esc: int = 0) -> np.ndarray[Any, np.dtype[np.void]]:
        """Takes what has been recorded of an ESC since the start or the last call: a row for each control period.

        The columns are those of the program's recordings: ``record()["rpm"]`` is the true speed. ``phase`` is an index
        of :data:`siskin.PHASES`; a number that is not there is NaN. A second takes 1.3 MB at 15 kHz.

        :raises siskin.Error: if the emulator was made without ``record=True``.
        """
        return _record.rows(self._laboratory.take_recorded(_index.one(self._laboratory.escs, esc)))

    @property
    def trace_hashes(self) -> list[str]:
        """A hash over the control's state in every step of each ESC, equal for equal inputs on any machine.

        :raises siskin.Error: if the emulator was made without ``trace=True``.
        """
        hashes = [self._laboratory.trace_hash(esc) for esc in range(self._laboratory.escs)]
        if any(found is None for found in hashes):
            raise Error("no trace is kept; make the emulator with trace=True")
        return [found for found in hashes if found is not None]

    scenario = staticmethod(scenario)
    sweep = staticmethod(sweep)
