"""Scenarios, one run each."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Integral
from typing import Any

from ._siskin import Error, Plan


@dataclass(frozen=True)
class Outcome:
    """The result of a scenario."""

    summary: dict[str, Any]
    """The whole result, as the program prints it with ``--json``."""

    @property
    def held(self) -> bool:
        """Whether no expectation failed."""
        return all(verdict["held"] is not False for verdict in self.summary["expectations"])

    @property
    def windows(self) -> dict[str, dict[str, Any]]:
        """The figures of each measuring window, by name."""
        return {window["name"]: window for window in self.summary["windows"]}

    @property
    def faults(self) -> list[str]:
        """Faults that turned the bridge off, as the ESC names them."""
        return list(self.summary["faults"])

    @property
    def warnings(self) -> list[str]:
        """What the ESC reported while the motor kept running, such as an open phase or a faulty sensor."""
        return list(self.summary.get("warnings", []))

    @property
    def trace_hash(self) -> str:
        """Hash over the control's state in every step."""
        return str(self.summary["trace_hash"])


def scenario(
    path: str | os.PathLike[str],
    overrides: Mapping[str, Any] | None = None,
    /,
    *,
    seed: int | None = None,
    record: str | os.PathLike[str] | None = None,
    **more: Any,
) -> Outcome:
    """Plays the only run of a scenario, or the first, as ``siskin-emulator scenario`` does: equal bits, equal figures.

    :param path: the scenario, a TOML file.
    :param seed: a seed in place of the file's.
    :param record: file to which each control period is written, as by ``--record``.
    :param overrides: keys of the file with their values, as ``{"params.CTL_RPM_MAX": 5000, "bench.load": "none"}``;
        array entries count from 0. ``**more`` are further ones.
    :raises siskin.Error: if the scenario is invalid or cannot be played, with the program's text.
    """
    if seed is not None and not (isinstance(seed, Integral) and 0 <= seed < 2**64):
        raise Error(f"seed = {seed}: give a whole number from 0 to 2^64 - 1")
    seeds = None if seed is None else (seed, seed)
    return Outcome(json.loads(Plan(path, seeds, {**(overrides or {}), **more}, record).play()))
