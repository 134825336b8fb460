"""Recordings as arrays."""

from typing import Any

import numpy as np

from ._siskin import COLUMNS, Error

_TYPES = {"t_s": "<f8", "phase": "u1", "faults": "u1"}

dtype: np.dtype[np.void] = np.dtype([(column, _TYPES.get(column, "<f4")) for column in COLUMNS])
"""The columns of a recording, with their types."""


def rows(packed: bytes | None) -> np.ndarray[Any, np.dtype[np.void]]:
    """Returns what the emulator has packed, as a writable array."""
    if packed is None:
        raise Error("nothing is recorded; create the emulator with record=True")
    return np.frombuffer(bytearray(packed), dtype)
