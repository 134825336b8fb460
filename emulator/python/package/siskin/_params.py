"""The ESCs' parameters as a mapping."""

from collections.abc import Iterator, MutableMapping

from . import _index
from ._siskin import PARAMETERS, Laboratory


class Params(MutableMapping[str, float]):
    """The parameters of the ESCs by name, as in the parameter table.

    ``params["CTL_MODE"]`` is the value of the first ESC, and ``params["CTL_MODE"] = 2`` sets it on all; ``params.of(2)``
    has the parameters of ESC 2 alone. A value is treated like one from a ground station: it is in force within a
    millisecond, it stores itself, and most are refused while the motor turns.

    :raises KeyError: if no parameter has the name.
    :raises siskin.Error: if a value is out of range or refused, with the reason.
    """

    def __init__(self, laboratory: Laboratory, escs: range | None = None) -> None:
        self._laboratory = laboratory
        self._escs = range(laboratory.escs) if escs is None else escs

    def of(self, esc: int) -> "Params":
        """The parameters of one ESC."""
        esc = _index.one(self._laboratory.escs, esc)
        return Params(self._laboratory, range(esc, esc + 1))

    def __getitem__(self, name: str) -> float:
        return self._laboratory.param(self._escs[0], name)

    def __setitem__(self, name: str, value: float) -> None:
        for esc in self._escs:
            self._laboratory.set_param(esc, name, value)

    def __delitem__(self, name: str) -> None:
        raise TypeError("a parameter cannot be deleted; set it to another value")

    def __iter__(self) -> Iterator[str]:
        return iter(PARAMETERS)

    def __len__(self) -> int:
        return len(PARAMETERS)

    def __repr__(self) -> str:
        return f"Params({dict(self)})"
