"""ESCs in simulated time, driven by a program."""

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
    """The throttle of each ESC, from 0 to 1, sent as a flight controller does: one frame per millisecond.

    0 is motor stop, and arms once held for 300 ms. ``None`` silences the wire, which the ESC takes for a lost signal.
    ``throttle[i] = 0.5`` sets one ESC, ``throttle[:] = 0.5`` all of them, and ``throttle[:] = [0.5, 0.4, 0.5, 0.4]``
    each in turn. A value takes effect with the next frame.
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

    Simulated time advances only by :meth:`advance`. The results depend, bit for bit, on the calls and the simulated
    times at which they are made, and not on how time is split into calls. Several threads may use it, one after the
    other; long calls let Python's other threads run.

    :param bench: a built-in bench (:data:`siskin.BENCHES`) or the path of a file in the same format: motor, load,
        supply, and the parameters that the ESCs need for them.
    :param escs: number of ESCs, 1 to 8. If there are several, each is a peripheral on MAVLink, component 140 and on.
    :param seed: seed of all randomness.
    :param params: parameters that override the bench's, by name. They are not stored.
    :param wire: throttle protocol, as in a scenario's ``bench.wire``: ``"dshot600"``, ``"servo"``...
    :param storage: the file behind the flash, ``PATH.i`` if there are several ESCs; this emulator locks it for as long
        as it lives. Without one nothing is kept.
    :param record: whether to keep each control period for :meth:`record`.
    :param trace: whether to hash the control's state for :attr:`trace_hashes`.
    :param keys: other keys of a scenario's ``[bench]``, such as ``bus="6s"``, ``load="none"`` or ``plant="switching"``.
    :raises siskin.Error: if a value is not possible; the text says what is.
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
        """Advances simulated time.

        :param seconds: how far, to the nanosecond.
        :raises siskin.Error: if the time is invalid, or the simulated motor has diverged.
        """
        self._laboratory.advance(seconds)

    @property
    def time_s(self) -> float:
        """Simulated time since the start, s."""
        return self._laboratory.now_ns / 1e9

    @property
    def state(self) -> list[EscState]:
        """The current state of each ESC and its motor, with the ESC's answers from the latest advance."""
        return self._laboratory.states()

    @property
    def throttle(self) -> Throttle:
        """The throttle of each ESC, to read and set."""
        return self._throttle

    @throttle.setter
    def throttle(self, throttle: Values) -> None:
        self._throttle[:] = throttle

    def send(self, esc: int, datagram: bytes, after_s: float = 0.0) -> None:
        """Sends a raw frame on an ESC's wire; set its :attr:`throttle` to ``None`` first.

        :param datagram: as over UDP, described in the emulator's guide under "The throttle wire over UDP".
        :param after_s: time of its first edge, s from now. Starts after any frame still being sent.
        :raises siskin.Error: if it is malformed, or more than 100 ms of frames are waiting.
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
        """Changes the ESCs' surroundings from now on. A value that is omitted or ``None`` stays unchanged.

        :param supply_v: open-circuit voltage of the supply, V, 0 to 100; replaces that of a battery, which then never
            runs empty.
        :param supply_ohm: resistance of the supply, Ω, 0 to 100.
        :param ambient_c: air temperature, °C, -60 to 150.
        :param torque_nm: torque on the shaft in addition to its load's, Nm, ±100, for all ESCs or for each; positive
            turns it with the phases in the order a, b, c.
        :param wind_rpm: air speed, as the speed at which it would turn the propeller by itself, rpm, ±100 000, likewise.
        :raises siskin.Error: if a value is out of range; nothing changes then.
        """
        escs = self._laboratory.escs
        torques = _index.each("torque_nm", escs, torque_nm)
        winds = _index.each("wind_rpm", escs, wind_rpm)
        self._laboratory.environment(supply_v, supply_ohm, ambient_c, torques, winds)

    @property
    def params(self) -> Params:
        """The parameters of all ESCs, by name, to read and set."""
        return self._params

    @property
    def mavlink(self) -> MavlinkPipe:
        """The MAVLink stream of all ESCs, as a byte pipe."""
        return self._mavlink

    @property
    def faults(self) -> Faults:
        """The faults of each ESC, to list, inject and mend."""
        return self._faults

    def record(self, esc: int = 0) -> np.ndarray[Any, np.dtype[np.void]]:
        """Returns what has been recorded of an ESC since the start or the last call: a row for each control period.

        The columns are those of the program's recordings: ``record()["rpm"]`` is the true speed. ``phase`` is an index
        into :data:`siskin.PHASES`; a missing number is NaN. A second takes 1.3 MB at 15 kHz.

        :raises siskin.Error: if the emulator was created without ``record=True``.
        """
        return _record.rows(self._laboratory.take_recorded(_index.one(self._laboratory.escs, esc)))

    @property
    def trace_hashes(self) -> list[str]:
        """A hash over the control's state in every step, for each ESC; equal for equal inputs on any machine.

        :raises siskin.Error: if the emulator was created without ``trace=True``.
        """
        hashes = [self._laboratory.trace_hash(esc) for esc in range(self._laboratory.escs)]
        if any(found is None for found in hashes):
            raise Error("no trace is kept; create the emulator with trace=True")
        return [found for found in hashes if found is not None]

    scenario = staticmethod(scenario)
    sweep = staticmethod(sweep)
