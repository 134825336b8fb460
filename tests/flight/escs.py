"""Four of the emulator's ESCs in lockstep, by the datagrams of `emulator/LOCKSTEP.md` alone."""

import json
import math
import signal
import socket
import struct
import subprocess

import dshot
from paths import PROGRAM

STATE, ADVANCE, ENVIRONMENT = 40, 41, 42
VERSION = 1
COUNT = 4
HEAD = struct.Struct("<BBBxIQII")
OF_ESC = struct.Struct("<dddddddddffffIBBH")
ANSWER = struct.Struct("<QH")
RUN = 5
"""The drive's phase while it drives the motor."""


class Esc:
    """What is known about one of them."""

    def __init__(self):
        self.rpm = 0.0
        self.supply_v = self.supply_a = 0.0
        self.reported_rpm = 0.0
        self.faults = 0
        self.armed = False
        self.does = 0
        self.starts = 0
        self.sent: list[int] = []
        """When the frames begin, ns."""
        self.replies: list[tuple[int, int]] = []
        """When the answered frame began, and the 12 data bits."""

    def take(self, block: tuple) -> None:
        does = block[15]
        self.starts += does == RUN and self.does != RUN
        self.does = does
        self.rpm, self.supply_a, self.supply_v = block[0], block[6], block[7]
        self.reported_rpm, self.faults, self.armed = block[9], self.faults | block[13], bool(block[14])


class Escs:
    """The emulator with four ESCs on the bench `quad-5-inch`."""

    def __init__(self, *options: object):
        command = [PROGRAM, "--bench", "quad-5-inch", "--escs", COUNT, "--speed", "lockstep", "--storage", "none"]
        command += ["--mavlink", "none", "--signal", "udp:127.0.0.1:0", "--json", *options]
        self.process = subprocess.Popen(
            [str(word) for word in command], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
        )
        ready = json.loads(self.process.stdout.readline())["ready"]
        _, host, port = ready["signal"].split(":")
        self.wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.wire.connect((host, int(port)))
        self.wire.settimeout(10.0)
        self.sequence = 0
        self.now_ns = 0
        self.all = [Esc() for _ in range(COUNT)]

    def advance(self, ns: int, frames: list[tuple[int, int, int]]) -> None:
        """Advances with frames: ESC, time from now in ns, and value. They are bidirectional DShot600."""
        body = b""
        for esc, after_ns, value in frames:
            datagram = dshot.datagram(value, dshot.BIDIRECTIONAL_DSHOT600)
            body += struct.pack("<BxHI", esc, len(datagram), after_ns) + datagram
            self.all[esc].sent.append(self.now_ns + after_ns)
        self._ask(struct.pack("<BBHII", ADVANCE, VERSION, len(frames), self._next(), ns) + body)

    def surround(self, supply_v: float, resistance_ohm: float, around: list[tuple[float, float]]) -> None:
        """Sets the pack, and each ESC's torque on its shaft, Nm, and its air as a speed, rpm.

        NaN leaves a quantity unchanged.
        """
        numbers = (len(around), self._next(), supply_v, resistance_ohm, math.nan)
        head = struct.pack("<BBBxIddd", ENVIRONMENT, VERSION, *numbers)
        self._ask(head + b"".join(struct.pack("<dd", *each) for each in around))

    def _next(self) -> int:
        self.sequence += 1
        return self.sequence

    def _ask(self, request: bytes) -> None:
        advanced = request[0] == ADVANCE
        self.wire.send(request)
        state = self.wire.recv(65_507)
        kind, version, count, sequence, self.now_ns, refused, lost = HEAD.unpack_from(state)
        assert (kind, version, count, sequence, refused, lost) == (STATE, VERSION, COUNT, self.sequence, 0, 0)
        at = HEAD.size + count * OF_ESC.size
        for index, esc in enumerate(self.all):
            block = OF_ESC.unpack_from(state, HEAD.size + index * OF_ESC.size)
            esc.take(block)
            for _ in range(block[16]):
                began_ns, length = ANSWER.unpack_from(state, at)
                at += ANSWER.size + length
                # The latest advance's are in every state until the next.
                if advanced:
                    esc.replies.append((began_ns, dshot.reply(state[at - length : at])))
        assert at == len(state)

    def summary(self) -> list[dict]:
        """Ends it, and returns its summary of each ESC since the start."""
        self.process.send_signal(signal.SIGINT)
        printed, _ = self.process.communicate(timeout=10.0)
        assert self.process.returncode == 0, self.process.returncode
        return json.loads(printed)["escs"]

    def close(self) -> None:
        """Ends it, if it has not ended by itself."""
        self.wire.close()
        self.process.kill()
        self.process.wait()
