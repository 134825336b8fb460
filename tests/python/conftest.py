"""Fixtures for every test."""

import contextlib
import sys

import pytest

import paths

sys.path.insert(0, str(paths.DIALECT))

from emulator import Emulator  # noqa: E402  (it needs the dialect's folder)


@pytest.fixture
def start():
    """Starts emulators with command line options, and ends them after the test."""
    with contextlib.ExitStack() as running:

        def start(*options, **named) -> Emulator:
            emulator = Emulator(*options, **named)
            running.callback(emulator.end)
            return emulator

        yield start


@pytest.fixture
def esc(start):
    """A client of a fresh emulator on the default bench, which is `esc.emulator`."""
    emulator = start()
    with emulator.connect() as esc:
        esc.emulator = emulator
        yield esc
