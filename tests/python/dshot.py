"""DShot as a flight controller sends it, written from the protocol rather than from the control."""

import socket
import threading
import time

DSHOT150, DSHOT300, DSHOT600 = 10, 11, 12
BIDIRECTIONAL_DSHOT600 = 22
KISS = 30
RAW_EDGES = 255
STOP = 0
EXTENDED_ON, EXTENDED_OFF = 13, 14
STANDS = 0xFFF
"""The data in a reply while the motor stands."""
LEAST, MOST = 48, 2047
HALF = (LEAST + MOST + 1) // 2
"""The step above the middle of 48..2047."""


def frame(value: int, telemetry: bool = False) -> int:
    """Returns the 16 bits: 11 of value, the telemetry request, 4 of checksum."""
    data = value << 1 | telemetry
    return data << 4 | (data ^ data >> 4 ^ data >> 8) & 0xF


def datagram(
    value: int, protocol: int = DSHOT600, bad_crc: bool = False, telemetry: bool = False
) -> bytes:
    """Returns a frame for the emulator's wire. A bidirectional one's checksum is inverted."""
    bits = frame(value, telemetry) ^ (0xF if protocol >= 20 else 0) ^ (0x5 if bad_crc else 0)
    return bytes([protocol]) + bits.to_bytes(2, "little")


GROUPS = "19 1B 12 13 1D 15 16 17 1A 09 0A 0B 1E 0D 0E 0F"
NIBBLES = {int(code, 16): nibble for nibble, code in enumerate(GROUPS.split())}


def reply(answer: bytes) -> int:
    """Returns the 12 data bits of a reply's datagram."""
    assert len(answer) == 9, answer
    levels = int.from_bytes(answer[1:5], "little")
    assert levels < 1 << 20, "the start bit is low"
    toggles = levels ^ levels >> 1
    nibbles = [NIBBLES[toggles >> shift & 0x1F] for shift in (15, 10, 5, 0)]
    assert nibbles[0] ^ nibbles[1] ^ nibbles[2] ^ nibbles[3] == 0xF, "the check sum is inverted"
    return nibbles[0] << 8 | nibbles[1] << 4 | nibbles[2]


def is_extended(data: int) -> bool:
    """Returns whether this is a word of extended telemetry."""
    return data >> 8 != 0 and not data & 0x100


def erpm(data: int) -> float:
    """Returns the electrical rpm of a reply that holds the speed."""
    return 0.0 if data == STANDS else 60e6 / ((data & 0x1FF) << (data >> 9))


def crc8(data: bytes) -> int:
    """Returns KISS telemetry's checksum: polynomial 0x07, from 0; 0 over a frame including its own."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc << 1 & 0xFF ^ (0x07 if crc & 0x80 else 0)
    return crc


class Throttle(threading.Thread):
    """Sends a value 1000 times a second until told otherwise; None is a silent wire.

    Frames that fall due while the machine is busy are skipped, as a flight controller would. The ESC's answers are
    kept in `answers`.
    """

    def __init__(self, port: int, value: int | None = STOP, protocol: int = DSHOT600):
        super().__init__(daemon=True)
        self.value = value
        self.protocol = protocol
        self.bad_crc = False
        self.telemetry = False
        self.sent = 0
        self.answers: list[bytes] = []
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
                        wire.send(datagram(value, self.protocol, self.bad_crc, self.telemetry))
                        self.sent += 1
                    except ConnectionRefusedError:
                        pass  # The emulator has ended; the test will say so.
                due = max(due + 0.001, time.monotonic() - 0.001)
                time.sleep(max(0.0, due - time.monotonic()))
                self._listen(wire)

    def _listen(self, wire: socket.socket) -> None:
        try:
            while True:
                self.answers.append(wire.recv(128, socket.MSG_DONTWAIT))
        except (BlockingIOError, ConnectionRefusedError):
            pass

    def replies(self, since: int = 0) -> list[int]:
        """Returns the data of the replies on the wire, from the answer with this number on."""
        return [reply(answer) for answer in self.answers[since:] if answer[0] == self.protocol]

    def __enter__(self) -> "Throttle":
        self.start()
        return self

    def __exit__(self, *_) -> None:
        self._ended.set()
        self.join()
