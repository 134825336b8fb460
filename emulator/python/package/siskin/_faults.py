"""Faults of the simulated ESCs."""

from collections.abc import Sequence
from typing import overload

from . import _index
from ._siskin import Laboratory


class Faults(Sequence[list[str]]):
    """The faults of each ESC: ``faults[i]`` lists those of ESC i that act or are to come.

    Kinds and values are those of a scenario's ``[[fault]]``, which the emulator's guide lists.
    """

    def __init__(self, laboratory: Laboratory) -> None:
        self._laboratory = laboratory

    def inject(
        self,
        esc: int,
        kind: str,
        *,
        phase: int | None = None,
        side: str | None = None,
        value: float | None = None,
        at_s: float | None = None,
        for_s: float | None = None,
    ) -> None:
        """Injects a fault, replacing any of the same kind.

        :param kind: such as ``"mosfet_open"``, ``"bus_sag"`` or ``"signal_loss"``.
        :param phase: 0 to 2.
        :param side: ``"low"`` or ``"high"``.
        :param value: in the kind's unit.
        :param at_s: when it begins, in simulated time; now if left out.
        :param for_s: how long it lasts, s; until it is mended if left out.
        :raises siskin.Error: if there is no such fault; the text says what there is.
        """
        at_s = self._laboratory.now_ns / 1e9 if at_s is None else at_s
        given = {"kind": kind, "phase": phase, "side": side, "value": value, "at_s": at_s, "for_s": for_s}
        keys = {"phase": int, "value": float, "at_s": float, "for_s": float}
        words = [f"{key} = {_toml(keys.get(key, str)(v))}" for key, v in given.items() if v is not None]
        self._laboratory.inject(_index.one(len(self), esc), ", ".join(words))

    def mend(self, esc: int | None = None) -> None:
        """Mends everything that faults have broken by now, on one ESC or on all."""
        for each in range(len(self)) if esc is None else [_index.one(len(self), esc)]:
            self._laboratory.mend(each)

    @overload
    def __getitem__(self, esc: int) -> list[str]: ...
    @overload
    def __getitem__(self, esc: slice) -> list[list[str]]: ...
    def __getitem__(self, esc: int | slice) -> list[str] | list[list[str]]:
        if isinstance(esc, slice):
            return [self._laboratory.faults(index) for index in range(len(self))[esc]]
        return self._laboratory.faults(_index.one(len(self), esc))

    def __len__(self) -> int:
        return self._laboratory.escs

    def __repr__(self) -> str:
        return f"Faults({self[:]})"


def _toml(value: object) -> str:
    """Returns a value in TOML's notation."""
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    return repr(value)
