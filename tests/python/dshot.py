"""DShot as a flight controller sends it, written from the protocol and not from the control."""

import socket
import threading
import time

DSHOT150, DSHOT300, DSHOT600 = 10, 11, 12
RAW_EDGES = 255
STOP = 0
LEAST, MOST = 48, 2047
HALF = (LEAST + MOST + 1) // 2
"""The step above the middle of 48..2047."""


def frame(value: int, telemetry: bool = False) -> int:
    """The 16 bits: 11 of value, the telemetry request, 4 of check sum."""
    data = value << 1 | telemetry
    return data << 4 | (data ^ data >> 4 ^ data >> 8) & 0xF


def datagram(value: int, protocol: int = DSHOT600, bad_crc: bool = False) -> bytes:
    """A frame for the emulator's wire."""
    bits = frame(value) ^ (0x5 if bad_crc else 0)
    return bytes([protocol]) + bits.to_bytes(2, "little")


class Throttle(threading.Thread):
    """Sends one value 1000 times a second until told otherwise; None is a silent wire.

    Frames that fell due while the machine was busy are left out, as a flight controller would.
    """

    def __init__(self, port: int, value: int | None = STOP, protocol: int = DSHOT600):
        super().__init__(daemon=True)
        self.value = value
        self.protocol = protocol
        self.bad_crc = False
        self.sent = 0
        self._port = port
        self._ended = threading.Event()

    def run(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
            wire.connect(("127.0.0.1", self._port))
            due = time.monotonic()
            while not self._ended.is_set():
                value = self.value
                if value is not None:
                    try:
                        wire.send(datagram(value, self.protocol, self.bad_crc))
                        self.sent += 1
                    except ConnectionRefusedError:
                        pass  # The emulator has ended; the test will say so.
                due = max(due + 0.001, time.monotonic() - 0.001)
                time.sleep(max(0.0, due - time.monotonic()))

    def __enter__(self) -> "Throttle":
        self.start()
        return self

    def __exit__(self, *_) -> None:
        self._ended.set()
        self.join()
