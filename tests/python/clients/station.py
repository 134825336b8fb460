"""MAVProxy without a terminal: commands go to its stdin, and what it prints is read."""

import os
import re
import subprocess
import sys
import threading
import time
from pathlib import Path

from desk import Desk
from esc import TIMEOUT_S


PROMPT = re.compile(r"(MAV|Mode\(0x[0-9a-f]{8}\))> ")
"""Another thread of it prints this, anywhere in a line."""


class MavProxy:
    """A session with an ESC. All its files go to `folder`."""

    def __init__(self, desk: Desk, folder: Path):
        folder.mkdir(exist_ok=True)
        clean = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "MAVLINK"))}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "MAVProxy.mavproxy"]
            + [f"--master={desk.pymavlink}", f"--baudrate={desk.baud}"],
            env={**clean, "HOME": str(folder), "PYTHONUNBUFFERED": "1"},
            cwd=folder,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._printed = ""
        self._news = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        while text := os.read(self._process.stdout.fileno(), 4096):
            with self._news:
                self._printed += text.decode()
                self._news.notify_all()

    def say(self, command: str) -> int:
        """Types a command; returns the place in the output from which its answer comes."""
        with self._news:
            place = len(self._printed)
        print(command, file=self._process.stdin, flush=True)
        return place

    def wait(self, pattern: str, place: int = 0, timeout: float = TIMEOUT_S) -> re.Match:
        """Returns the first match after the place; fails the test if there is none."""
        wanted = re.compile(pattern, re.MULTILINE)
        with self._news:
            found = self._news.wait_for(lambda: wanted.search(self._since(place)), timeout)
            assert found, f"no {pattern!r} in\n{self._since(place)}"
            return found

    def _since(self, place: int) -> str:
        return PROMPT.sub("", self._printed[place:])

    def ask(self, command: str, pattern: str, timeout: float = TIMEOUT_S) -> re.Match:
        """Types a command and waits for its answer."""
        return self.wait(pattern, self.say(command), timeout)

    def wait_value(self, name: str, value: float, timeout: float = TIMEOUT_S) -> bool:
        """Returns whether the parameter reaches this value: the ESC's answer may take time."""
        until = time.monotonic() + timeout
        while float(self.ask(f"param show {name}", rf"^{name} +(\S+)$")[1]) != value:
            if time.monotonic() > until:
                return False
            time.sleep(0.1)
        return True

    def set(self, name: str, value: float) -> None:
        """Sets a parameter, repeatedly if need be: MAVProxy gives up after three packets in 3 s."""
        for _ in range(5):
            self.say(f"param set {name} {value}")
            if self.wait_value(name, value, timeout=4.0):
                return
        raise AssertionError(f"{name} is not {value}")

    def listed(self, timeout: float = TIMEOUT_S) -> dict[str, float]:
        """Returns all parameters, as shown once MAVProxy has the list.

        To have received a list is not enough: before it hears a heartbeat it asks nobody in particular, and asks again
        once it knows the ESC.
        """
        until = time.monotonic() + timeout
        while True:
            place = self.say("param show *")
            self.say("param status")
            end = self.wait(r"((?:.*\n)*)Have (\d+)/(\d+) params", place)
            if end[2] == end[3] != "0":
                break
            assert time.monotonic() < until, f"only {end[2]} of {end[3]}"
            time.sleep(0.2)
        shown = re.findall(r"^([A-Z0-9_]+) +(\S+)$", end[1], re.MULTILINE)
        assert len(shown) == int(end[3]), end[0]
        return {name: float(value) for name, value in shown}

    def close(self) -> None:
        """Quits it as a person does, by the end of the input, once it has answered everything."""
        # While it unloads its modules its threads run with half of them, and some print a traceback.
        self.ask("param status", r"Have \d+/\d+ params")
        with self._news:
            assert "Traceback" not in self._printed, self._printed
        self._process.stdin.close()
        try:
            self._process.wait(TIMEOUT_S)
        finally:
            self._process.kill()
        self._reader.join()
        self._process.stdout.close()

    def __enter__(self) -> "MavProxy":
        return self

    def __exit__(self, *_) -> None:
        if self._process.poll() is None:
            self.close()
