"""The Python module in a process that is forked: the child works, or is told why not, and never hangs."""

import os
import signal
import threading
import time

import pytest

import siskin
from paths import SCENARIOS

CHILD_S = 20.0
"""For what a child does in a second, on a busy machine."""


def child(work) -> str:
    """Forks; returns what the child makes of it."""
    reader, writer = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(reader)
        try:
            text = str(work())
        except BaseException as error:
            text = f"{type(error).__name__}: {error}"
        os.write(writer, text.encode())
        os._exit(0)
    os.close(writer)
    until = time.monotonic() + CHILD_S
    while os.waitpid(process, os.WNOHANG) == (0, 0):
        if time.monotonic() > until:
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)
            raise AssertionError("the child hangs")
        time.sleep(0.01)
    with os.fdopen(reader) as told:
        return told.read()


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_fork_in_an_advance_leaves_no_child_waiting():
    emulator = siskin.Emulator("bosso")
    ended = threading.Event()

    def go_on():
        while not ended.is_set():
            emulator.advance(0.3)

    thread = threading.Thread(target=go_on)
    thread.start()

    def advanced():
        emulator.advance(0.01)
        return "advanced"

    try:
        told = []
        for wait in range(12):
            time.sleep(0.003 * wait)
            told.append(child(advanced))
    finally:
        ended.set()
        thread.join()
    lost = "Error: the process was forked while another thread advanced this emulator; create one after the fork"
    assert set(told) <= {"advanced", lost} and lost in told, told
    assert child(advanced) == "advanced", "nobody held it"
    emulator.advance(0.01)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_child_plays_what_its_parent_has_played():
    path = SCENARIOS / "steps.toml"
    wanted = siskin.scenario(path).trace_hash
    table = siskin.sweep(path, seeds=range(1, 3))
    assert child(lambda: siskin.scenario(path).trace_hash) == wanted
    assert child(lambda: siskin.sweep(path, seeds=range(1, 3)) == table) == "True"
