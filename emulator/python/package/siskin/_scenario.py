"""Scenarios, one run each."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ._siskin import Plan


@dataclass(frozen=True)
class Outcome:
    """What a scenario came to."""

    summary: dict[str, Any]
    """All of it, as the program prints it with ``--json``."""

    @property
    def held(self) -> bool:
        """Whether no expectation failed."""
        return all(verdict["held"] is not False for verdict in self.summary["expectations"])

    @property
    def windows(self) -> dict[str, dict[str, Any]]:
        """The figures of each measuring window, by its name."""
        return {window["name"]: window for window in self.summary["windows"]}

    @property
    def faults(self) -> list[str]:
        """Faults that have turned the bridge off, as the ESC names them."""
        return list(self.summary["faults"])

    @property
    def warnings(self) -> list[str]:
        """What the ESC has told while the motor turned on with it: an open phase, a sensor at fault."""
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
    :param seed: another seed than the file's.
    :param record: where each control period is written, as ``--record`` has it.
    :param overrides: keys of the file with the value that each takes, as ``{"params.CTL_RPM_MAX": 5000,
        "bench.load": "none"}``; the entries of an array count from 0. ``**more`` are others.
    :raises siskin.Error: if it makes no sense or cannot be played, with the program's text.
    """
    seeds = None if seed is None else (seed, seed)
    return Outcome(json.loads(Plan(path, seeds, {**(overrides or {}), **more}, record).play()))
