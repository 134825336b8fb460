"""Indices of ESCs, and values for each."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ._siskin import Error

Values: TypeAlias = float | Sequence[float | None] | NDArray[np.floating] | None
"""One value for all ESCs, or one for each in turn."""


def one(escs: int, esc: int) -> int:
    """Returns the number of one of this many ESCs; -1 is the last, as in any list."""
    try:
        return range(escs)[esc]
    except IndexError:
        raise IndexError(f"there is no ESC {esc}; give 0 to {escs - 1}") from None


def each(name: str, escs: int, values: Values) -> list[float | None]:
    """Returns a value for each of this many ESCs."""
    if values is None or isinstance(values, int | float | np.number):
        return [None if values is None else float(values)] * escs
    listed = [None if value is None else float(value) for value in values]
    if len(listed) != escs:
        raise Error(f"{name}: {len(listed)} values for {escs} ESCs")
    return listed
