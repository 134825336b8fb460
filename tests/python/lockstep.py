"""A lockstep client of the emulator, written from emulator/LOCKSTEP.md alone."""

import shutil
import socket
import struct
import subprocess
from dataclasses import dataclass
from pathlib import Path

from dshot import BIDIRECTIONAL_DSHOT600, datagram
from paths import ROOT

VERSION = 1
HEAD = struct.Struct("<BBBBIQII")
ESC = struct.Struct("<9d4fIBBH")
MS = 1_000_000

# What the C example drives.
FOUR = ("--escs", 4, "--bus", "6s")


def build_example(folder: Path) -> Path:
    """Compiles the C example without a warning; returns its path."""
    path = folder / "example"
    source = ROOT / "emulator" / "lockstep" / "example.c"
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2"]
    subprocess.run([shutil.which("cc"), *strict, "-o", path, source, "-lm"], check=True)
    return path


@dataclass
class EscState:
    """What is reported about an ESC, with its answers: when the frame began, and the datagram."""

    rpm: float
    angle_turns: float
    torque_nm: float
    currents_a: tuple[float, float, float]
    bus_a: float
    bus_v: float
    board_c: float
    reported: tuple[float, float, float, float]
    faults: int
    armed: bool
    phase: int
    answers: list[tuple[int, bytes]]


class State:
    """A state as received, and its fields."""

    def __init__(self, raw: bytes):
        kind, version, count, reserved, self.sequence, self.time_ns, self.refused, self.left_out = HEAD.unpack_from(raw)
        assert (kind, version, reserved) == (40, VERSION, 0), raw[:4]
        self.raw, self.escs = raw, []
        at = HEAD.size + count * ESC.size
        for index in range(count):
            f = ESC.unpack_from(raw, HEAD.size + index * ESC.size)
            answers = []
            for _ in range(f[16]):
                asked_ns, length = struct.unpack_from("<QH", raw, at)
                answers.append((asked_ns, raw[at + 10 : at + 10 + length]))
                at += 10 + length
            self.escs.append(EscState(*f[:3], f[3:6], *f[6:9], f[9:13], f[13], bool(f[14]), f[15], answers))
        assert at == len(raw), "nothing is left over"


def frame(esc: int, offset_ns: int, payload: bytes) -> bytes:
    """Returns a frame within an advance."""
    return struct.pack("<BBHI", esc, 0, len(payload), offset_ns) + payload


class Lockstep:
    """The simulator's side."""

    def __init__(self, port: int):
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.connect(("127.0.0.1", port))
        self.link.settimeout(10.0)
        self.state = self.ask()

    def close(self) -> None:
        self.link.close()

    def exchange(self, request: bytes) -> State:
        """Sends raw bytes, and returns the state that answers them."""
        self.link.send(request)
        return State(self.link.recv(65536))

    def ask(self) -> State:
        return self.exchange(bytes([43, VERSION]))

    def advance_bytes(self, time_ns: int, frames: list[bytes], sequence: int | None = None) -> bytes:
        sequence = self.state.sequence + 1 if sequence is None else sequence
        return struct.pack("<BBHII", 41, VERSION, len(frames), sequence, time_ns) + b"".join(frames)

    def turn(self, request: bytes) -> State:
        """Sends a request that must be obeyed."""
        before = self.state.sequence
        self.state = self.exchange(request)
        assert self.state.sequence == before + 1, f"refused: {self.state.refused}"
        return self.state

    def advance(self, time_ns: int, frames: list[bytes] = ()) -> State:
        return self.turn(self.advance_bytes(time_ns, list(frames)))

    def environment(self, supply_v=float("nan"), supply_ohm=float("nan"), ambient_c=float("nan"), shafts=()) -> State:
        sequence = self.state.sequence + 1
        request = struct.pack("<BBBBI3d", 42, VERSION, len(shafts), 0, sequence, supply_v, supply_ohm, ambient_c)
        return self.turn(request + b"".join(struct.pack("<2d", *shaft) for shaft in shafts))

    def throttle(self, milliseconds: int, values: list[int | None], protocol: int = BIDIRECTIONAL_DSHOT600) -> State:
        """Sends a frame per millisecond to each ESC; None is a silent wire."""
        escs = [(esc, value) for esc, value in enumerate(values) if value is not None]
        frames = [frame(esc, 10_000 * esc, datagram(value, protocol)) for esc, value in escs]
        for _ in range(milliseconds):
            self.advance(MS, frames)
        return self.state

    def run_up(self, values: list[int]) -> State:
        """Arms and turns, within two simulated seconds."""
        self.throttle(400, [0] * len(values))
        assert all(esc.armed for esc in self.state.escs)
        return self.throttle(1600, values)
