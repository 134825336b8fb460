"""What `siskin` does when it is interrupted: nothing that it began in the ESC goes on."""

import os
import pty
import signal
import subprocess
import time

import pytest
import siskin_dialect as dialect

from paths import TOOL

SHOWN_S = 20.0
ENDS_S = 2.0
"""An identification takes ten seconds, and a self-test most of one."""


IDENTIFY = 31010
"""Parameter 1 begins it, 0 ends it."""


@pytest.fixture
def tested(start):
    """An emulator that has tested itself: until then it identifies nothing."""
    emulator = start()
    with emulator.connect() as esc:
        until = time.monotonic() + SHOWN_S
        while esc.command(IDENTIFY, 1) == dialect.MAV_RESULT_TEMPORARILY_REJECTED:
            assert time.monotonic() < until
            time.sleep(0.1)
        assert esc.command(IDENTIFY, 0) == dialect.MAV_RESULT_ACCEPTED
        # It is acknowledged too, and the shaft comes to rest.
        time.sleep(0.5)
    return emulator


class Told:
    """The tool, with standard error on a terminal."""

    def __init__(self, emulator, *arguments):
        reader, terminal = pty.openpty()
        command = [str(TOOL), "--connect", f"tcp:127.0.0.1:{emulator.port}", *arguments]
        self.process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=terminal, text=True
        )
        os.close(terminal)
        self.reader = reader
        self.text = ""

    def read_until(self, word: str) -> None:
        until = time.monotonic() + SHOWN_S
        while word not in self.text:
            assert time.monotonic() < until, self.text
            self.text += os.read(self.reader, 4096).decode()

    def end(self) -> int:
        status = self.process.wait(ENDS_S)
        try:
            while more := os.read(self.reader, 4096):
                self.text += more.decode()
        except OSError:
            pass
        os.close(self.reader)
        return status

    def lines(self) -> list[str]:
        """Returns what stays on the terminal."""
        rows = self.text.replace("\r\n", "\n").split("\n")
        return [row.rsplit("\r\x1b[K", maxsplit=1)[-1] for row in rows if row.strip()]


@pytest.mark.parametrize(
    ("sent", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=["SIGINT", "SIGTERM"]
)
def test_an_identification_ends_with_the_tool(tested, sent, status):
    tool = Told(tested, "identify")
    tool.read_until("phase B")
    assert "Ctrl-C ends it" in tool.text
    tool.process.send_signal(sent)
    assert tool.end() == status
    assert tool.lines() == ["siskin: identification: interrupted; the ESC has ended it"]
    with tested.connect() as esc:
        # It is over, and the shaft was at rest in it: another may begin.
        time.sleep(0.5)
        assert esc.command(IDENTIFY, 1) == dialect.MAV_RESULT_IN_PROGRESS
        assert esc.command(IDENTIFY, 0) == dialect.MAV_RESULT_ACCEPTED


def test_a_self_test_ends_by_itself(start):
    emulator = start()
    tool = Told(emulator, "check")
    tool.read_until("self-test")
    tool.process.send_signal(signal.SIGINT)
    assert tool.end() == 130
    assert tool.lines() == ["siskin: self-test: interrupted; the ESC ends it by itself within a second"]


def test_a_second_signal_ends_the_tool_whatever_the_esc_does(tested):
    tool = Told(tested, "identify")
    tool.read_until("phase")
    # It answers nothing any more, but its socket still takes bytes.
    tested.process.send_signal(signal.SIGSTOP)
    tool.process.send_signal(signal.SIGINT)
    time.sleep(0.3)
    assert tool.process.poll() is None, "it still tries to end the identification"
    tool.process.send_signal(signal.SIGINT)
    assert tool.end() == -signal.SIGINT
    tested.process.send_signal(signal.SIGCONT)
