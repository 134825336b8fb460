"""Many runs of a scenario, here or on a Dask cluster."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from numbers import Integral
from pathlib import Path
from typing import Any, TypeAlias, overload

import numpy as np

from ._siskin import Error, Plan, write_table

Cell: TypeAlias = None | bool | int | float | str
"""A value in a row."""

SEEDS = 2**64
"""Seeds are below it."""

Cells: TypeAlias = list[tuple[str, Cell]]


class Table(Sequence[Mapping[str, Cell]]):
    """A row for each run: its seed, the swept or drawn keys, every figure of every window, and the verdicts.

    A run that was refused has none of the figures: it is not ``held``, and ``error`` says why.

    ``table[0]["held"]`` says whether all expectations of the first run held; ``table["steady.rpm_mean"]`` is a column.
    ``pandas.DataFrame(list(table))`` makes a data frame of it. Two tables are equal if every bit of them is.
    """

    def __init__(self, rows: list[Cells]) -> None:
        self._rows = rows

    @overload
    def __getitem__(self, at: int) -> dict[str, Cell]: ...
    @overload
    def __getitem__(self, at: slice) -> Table: ...
    @overload
    def __getitem__(self, at: str) -> np.ndarray[Any, np.dtype[Any]]: ...
    def __getitem__(self, at: int | slice | str) -> dict[str, Cell] | Table | np.ndarray[Any, np.dtype[Any]]:
        if isinstance(at, slice):
            return Table(self._rows[at])
        if isinstance(at, int):
            return dict(self._rows[at])
        if at not in self.columns:
            raise KeyError(f"there is no column {at}")
        return _array([row.get(at) for row in self])

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[dict[str, Cell]]:
        return (dict(row) for row in self._rows)

    def __eq__(self, other: object) -> bool:
        # By their texts, which give each double exactly, and are equal for two missing values.
        return isinstance(other, Table) and repr(self._rows) == repr(other._rows)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        failed = sum(row["held"] is False for row in self)
        return f"<Table of {len(self)} runs, {failed} failed>"

    @property
    def columns(self) -> list[str]:
        """The names of all columns, in order."""
        names = dict.fromkeys(name for row in self._rows for name, _ in row)
        last = {"held": 1, "error": 2}
        return sorted(names, key=lambda name: last.get(name, 0))

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Writes the table as CSV, byte for byte what the program writes with ``--table``.

        :raises siskin.Error: if the path does not end in ``.csv``, or cannot be written.
        """
        write_table(path, self._rows)


def sweep(
    path: str | os.PathLike[str],
    overrides: Mapping[str, Any] | None = None,
    /,
    *,
    seeds: Sequence[int] | None = None,
    threads: int | None = None,
    client: Any = None,
    retries: int = 3,
    **more: Any,
) -> Table:
    """Plays all runs of a scenario, on all cores or on a cluster; the table is the same, bit for bit.

    :param path: the scenario, a TOML file.
    :param seeds: plays it once for each of these seeds, consecutive ones as ``range(1, 201)``.
    :param threads: number of runs at once on this machine, as far as there are runs, and at most four per core; one per
        core if left out.
    :param client: a ``dask.distributed.Client``, whose workers play the runs. They must find the scenario, and the
        files that it names, under the same path.
    :param retries: how often the cluster retries a part that has failed.
    :param overrides: keys of the file with one value each, as for :func:`siskin.scenario`.
    :raises siskin.Error: if the scenario is invalid or cannot be played, with the program's text.
    """
    ends, given = _ends(seeds), {**(overrides or {}), **more}
    if threads is not None and not (isinstance(threads, Integral) and threads >= 1):
        raise Error(f"threads = {threads}: give a whole number from 1")
    if client is None:
        plan = Plan(path, ends, given, None)
        return Table(plan.rows(0, plan.runs, None if threads is None else min(int(threads), plan.runs)))
    if threads is not None:
        raise Error("threads applies to this machine and client to a cluster; give one of them")
    return Table(_on_cluster(client, Path(path).resolve(), ends, given, retries))


def _on_cluster(
    client: Any, path: Path, ends: tuple[int, int] | None, overrides: dict[str, Any], retries: int
) -> list[Cells]:
    runs = Plan(path, ends, overrides, None).runs
    text = _hash(path)
    # Parts are small, so that all workers end at about the same time and little is lost with one.
    workers = sum(client.nthreads().values()) or 1
    step = max(1, runs // (16 * workers))
    parts = [(first, min(first + step, runs)) for first in range(0, runs, step)]
    # With `pure`, an earlier equal sweep would answer, even if the files have changed since.
    futures = client.map(
        _part, parts, path=path, ends=ends, overrides=overrides, text=text, pure=False, retries=retries
    )
    return [row for rows in client.gather(futures) for row in rows]


def _part(
    part: tuple[int, int], path: Path, ends: tuple[int, int] | None, overrides: dict[str, Any], text: str
) -> list[Cells]:
    """Plays some of the runs on a worker: on one thread, since each of a worker's threads has a part of its own."""
    if _hash(path) != text:
        raise Error(f"{path}: the file on this worker differs from the client's; give both the same")
    return Plan(path, ends, overrides, None).rows(*part, 1)


def _hash(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise Error(f"{path}: {error.strerror}") from error


def _ends(seeds: Sequence[int] | None) -> tuple[int, int] | None:
    if seeds is None:
        return None
    try:
        given = seeds if isinstance(seeds, range) else list(seeds)
        ends = int(given[0]), int(given[-1])
        consecutive = range(ends[0], ends[0] + len(given))
        # A long range is compared by its ends.
        are_consecutive = given == (consecutive if isinstance(given, range) else [*consecutive])
    except (TypeError, ValueError, IndexError, OverflowError):
        are_consecutive = False
    if not are_consecutive or not 0 <= ends[0] <= ends[1] < SEEDS:
        raise Error(f"seeds = {seeds}: give consecutive seeds, such as range(1, 201)")
    return ends


def _array(values: list[Cell]) -> np.ndarray[Any, np.dtype[Any]]:
    """Returns a column: numbers as f64 with NaN for missing ones, flags as bool, anything else as objects."""
    if all(isinstance(value, bool) for value in values):
        return np.array(values, dtype=bool)
    if all(value is None or isinstance(value, int | float) and not isinstance(value, bool) for value in values):
        return np.array([np.nan if value is None else value for value in values], dtype=float)
    return np.array(values, dtype=object)
