"""Betaflight's SITL, made by `build`, held in step."""

import os
import socket
import struct
import subprocess
from pathlib import Path

from paths import TARGET

CACHE = TARGET / "flight"
PROGRAM = CACHE / "betaflight_4.6.0_SITL"
CLOCK = CACHE / "held.so"
EEPROM = CACHE / "eeprom.bin"

GRANT = struct.Struct("<Q18dd16H")
REPORT = struct.Struct("<QQH2x16fHH")
"""As in `held.c`."""
BEGIN_NS = 1_000_000_000
"""Its clock when it has started."""


class Betaflight:
    """The program, which runs only within `advance`."""

    def __init__(self, folder: Path):
        """Starts it in a folder that holds its `eeprom.bin`, and where it writes its log."""
        own, its = socket.socketpair()
        self.link = own
        with its, open(folder / "betaflight.log", "w") as log:
            environment = {"LD_PRELOAD": str(CLOCK), "HELD_LINK": str(its.fileno())}
            self.process = subprocess.Popen(
                [str(PROGRAM)], cwd=folder, pass_fds=[its.fileno()], stdin=subprocess.DEVNULL,
                env={**os.environ, **environment}, stdout=log, stderr=subprocess.STDOUT,
            )
        self.link.settimeout(20.0)
        self.report = self._listen()

    def advance(self, until_ns: int, state: list, sticks: list) -> tuple[int, tuple]:
        """Takes a state and the sticks, runs until this time since its start, and returns when it last wrote its
        motors' outputs, and those, in us.

        It writes them once after each state.
        """
        stamp_s = until_ns * 1e-9
        self.link.sendall(GRANT.pack(until_ns + BEGIN_NS, stamp_s, *state, stamp_s, *sticks))
        self.report = self._listen()
        return self.report[1] - BEGIN_NS, self.report[3:7]

    @property
    def command_line_port(self) -> int:
        """Where it serves its command line, on loopback."""
        return self.report[-2]

    def _listen(self) -> tuple:
        data = self.link.recv(REPORT.size, socket.MSG_WAITALL)
        if len(data) < REPORT.size:
            raise EOFError("Betaflight has ended")
        return REPORT.unpack(data)

    def close(self) -> None:
        """Ends it, if it has not ended by itself."""
        self.link.close()
        self.process.kill()
        self.process.wait()
