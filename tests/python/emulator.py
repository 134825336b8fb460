"""The emulator's program: starts, watches and ends it."""

import json
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

from dshot import Throttle
from esc import TIMEOUT_S, Esc
from paths import PROGRAM

PATIENT = ("--param", "INP_LOSS_MS=500")
"""For a flight controller that is a thread on a busy machine: its frames may have longer gaps than the default
allows."""

MOTOR = "MOT_POLE_PAIRS MOT_R_MOHM MOT_L_UH MOT_FLUX_MWB MOT_J_GCM2".split()
"""What the default bench states about its motor, and the factory leaves at 0: not known."""

SETTINGS = (
    "CTL_SLEW_RPM_S CTL_BW_CUR_HZ CTL_BW_SPD_HZ STA_PARK_AS STA_RAMP_A STA_RAMP_RPM_S STA_RUN_RPM"
).split()
"""What else the default bench sets, and the factory leaves at 0: from the motor."""

OF_BENCH = (*MOTOR, *SETTINGS, "STA_MODE")


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    """Returns a port that is free now."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def run(*arguments: object, timeout: float = 60.0) -> subprocess.CompletedProcess:
    """Runs the emulator to its end."""
    command = [str(PROGRAM), *map(str, arguments)]
    return subprocess.run(
        command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout
    )


def simulate(*arguments: object) -> dict:
    """Runs the emulator as fast as possible, without MAVLink, and returns its summary."""
    wire = f"udp:127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
    fixed = ("--speed", "max", "--mavlink", "none", "--signal", wire, "--web", "none", "--json")
    ended = run("run", *fixed, "--storage", "none", *arguments)
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


def scenario(path: Path, *arguments: object) -> tuple[int, dict]:
    """Plays a scenario; returns its exit status and summary."""
    ended = run("scenario", path, "--json", *arguments)
    assert ended.returncode in (0, 1), f"status {ended.returncode}: {ended.stderr}"
    return ended.returncode, json.loads(ended.stdout)


def windows_of(summary: dict) -> dict:
    """Returns a summary's windows by name."""
    return {window["name"]: window for window in summary["windows"]}


class Emulator:
    """An ESC in real time, on ports of its own: the emulator's, or another program with its options."""

    def __init__(
        self,
        *options: object,
        storage: object = "none",
        program: tuple = (PROGRAM,),
        speed: object = 1,
        web: object = "none",
    ):
        self.port = free_port()
        self.signal_port = free_port(socket.SOCK_DGRAM)
        self._output = tempfile.TemporaryFile("w+")
        command = [*program, "--signal", f"udp:127.0.0.1:{self.signal_port}", "--speed", speed]
        # The server comes last: when it answers, the endpoints among the options are open.
        command += ["--storage", storage, "--web", web, *options, "--mavlink", f"tcpin:127.0.0.1:{self.port}"]
        self.process = subprocess.Popen(
            [str(part) for part in command],
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=subprocess.STDOUT,
        )
        self._wait_for_port()

    def _wait_for_port(self) -> None:
        until = time.monotonic() + TIMEOUT_S
        while time.monotonic() < until and self.process.poll() is None:
            try:
                socket.create_connection(("127.0.0.1", self.port), timeout=1.0).close()
                return
            except OSError:
                time.sleep(0.02)
        self.kill()
        raise AssertionError(f"the emulator did not start: {self.output()}")

    def output(self) -> str:
        """Returns what it has printed so far."""
        self._output.seek(0)
        return self._output.read()

    def connect(self, **address: int) -> Esc:
        """Returns a new MAVLink client over TCP."""
        return Esc.tcp(self.port, **address)

    def throttle(self, *arguments, **options) -> Throttle:
        """Returns a flight controller on the throttle wire."""
        return Throttle(self.signal_port, *arguments, **options)

    def kill(self) -> int:
        """Ends it as a power cut would; returns its exit status, which SIGKILL makes -9."""
        self.process.kill()
        return self.process.wait()

    def end(self) -> None:
        """Ends it; fails the test if the program has died by itself."""
        status = self.kill()
        output = self.output()
        self._output.close()
        assert status == -signal.SIGKILL, f"it ended by itself, with status {status}: {output}"
        assert "panicked" not in output, output
