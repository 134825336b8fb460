"""A request to end ends the emulator at once, whatever it is doing."""

import signal
import socket
import struct
import subprocess
import time

import pytest

from emulator import free_port
from paths import PROGRAM, SCENARIOS

ENDS_S = 1.0
SHAPES = {
    "paced": ("run", "--speed", "1"),
    "fast": ("run", "--speed", "1000", "--escs", "8"),
    "slow": ("run", "--speed", "0.001"),
    "as fast as it can": ("run", "--speed", "max", "--bench", "quad-5-inch"),
    "scenario": ("scenario", SCENARIOS / "flight-calm.toml", "--set", "bench.duration_s=100000"),
    "survey": ("scenario", SCENARIOS / "random-drives.toml", "--seeds", "1..100000"),
    "matrix": ("matrix",),
    "reproduce": ("reproduce", "colton"),
    "bench": ("bench",),
}


def start(*arguments: object) -> subprocess.Popen:
    command = [str(PROGRAM), *map(str, arguments)]
    if arguments[0] == "run":
        wire = f"udp:127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
        command += ["--mavlink", "none", "--signal", wire, "--storage", "none", "--web", "none"]
    silent = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=silent, stdout=silent, stderr=silent)


def ends(process: subprocess.Popen) -> None:
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(ENDS_S)
    finally:
        process.kill()


@pytest.mark.parametrize("arguments", SHAPES.values(), ids=SHAPES)
def test_a_request_to_end_is_obeyed_within_a_second(arguments):
    process = start(*arguments)
    time.sleep(1.0)
    assert process.poll() is None, "it has ended before"
    ends(process)


def test_an_advance_in_lockstep_is_cut_short():
    """A second of eight ESCs with each switching edge takes longer than that."""
    port = free_port(socket.SOCK_DGRAM)
    process = subprocess.Popen(
        [str(PROGRAM), "run", "--speed", "lockstep", "--escs", "8", "--plant", "switching"]
        + ["--mavlink", "none", "--signal", f"udp:127.0.0.1:{port}", "--storage", "none"],
        stdout=subprocess.PIPE,
    )
    process.stdout.readline()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        # Advances of a second, by the layout of LOCKSTEP.md.
        for sequence in (1, 2, 3):
            request = struct.pack("<BBHII", 41, 1, 0, sequence, 1_000_000_000)
            link.sendto(request, ("127.0.0.1", port))
        time.sleep(0.2)
        ends(process)
