"""A campaign: many cases, each in a folder of its own, several at a time."""

import argparse
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path


def played(cases: list, play, jobs: int):
    """Yields each case with what `play` returns for it in an empty folder, in order."""

    def one(case):
        with tempfile.TemporaryDirectory() as folder:
            return play(Path(folder), case)

    # Each waits for a program, or for one in this process that lets others run.
    with ThreadPoolExecutor(jobs) as pool:
        yield from zip(cases, pool.map(one, cases))


def words(text: str, motors: int, **more: tuple[int, str]) -> argparse.Namespace:
    """Parses the command line: how many random motors, the first one's number, how many runs at a time, and more by
    name, with a default and a description. All except the first one's number are at least 1."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motors", type=int, default=motors, help="how many random motors")
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time")
    for name, (default, what) in more.items():
        parser.add_argument(f"--{name}", type=int, default=default, help=what)
    given = parser.parse_args()
    for name in ("motors", "jobs", *more):
        if getattr(given, name) < 1:
            parser.error(f"--{name} takes 1 or more")
    return given


def numbers(given: argparse.Namespace) -> range:
    """Returns the numbers of the random motors."""
    return range(given.first, given.first + given.motors)
