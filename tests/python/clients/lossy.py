"""A UDP path that loses, doubles and delays packets, the same ones in every run."""

import contextlib
import random
import select
import socket
import threading
import time

LATE_S = 0.05
"""A delayed packet leaves after the next one, or after this time if none comes."""


class Way:
    """One direction of the path."""

    def __init__(self, seed: int, share: float):
        self._random = random.Random(seed)
        self._share = share
        self._held: list[bytes] = []
        self._since = 0.0
        self.taken = self.lost = self.doubled = self.late = 0

    def take(self, packet: bytes, now: float) -> list[bytes]:
        """Returns what leaves when this packet comes."""
        self.taken += 1
        # Three draws each time, so that a packet's fate only depends on its number.
        lost, doubled, late = (self._random.random() < self._share for _ in range(3))
        if lost:
            self.lost += 1
            return []
        copies = [packet, packet] if doubled else [packet]
        self.doubled += doubled
        if late:
            self.late += 1
            self._since = now
            self._held += copies
            return []
        return copies + self._release()

    def overdue(self, now: float) -> list[bytes]:
        """Returns what has been held back for long enough."""
        return self._release() if now - self._since >= LATE_S else []

    def _release(self) -> list[bytes]:
        held, self._held = self._held, []
        return held


class Lossy:
    """Stands between a client, which sends to `port`, and the emulator's `udpin` at `far_port`.

    In each direction the share of the packets is lost; of the rest, the share is doubled, and the share arrives after
    the next one. `far_side` is the address that the emulator sees.
    """

    def __init__(self, far_port: int, seed: int, share: float = 0.2):
        self._near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._near.bind(("127.0.0.1", 0))
        self._far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._far.connect(("127.0.0.1", far_port))
        self.port = self._near.getsockname()[1]
        self.far_side = self._far.getsockname()
        self.up, self.down = Way(2 * seed, share), Way(2 * seed + 1, share)
        self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        client = None
        while not self._ended:
            ready = select.select([self._near, self._far], [], [], LATE_S / 5)[0]
            now = time.monotonic()
            up, down = self.up.overdue(now), self.down.overdue(now)
            # If nobody listens at the other end, that is one more way to lose a packet.
            with contextlib.suppress(ConnectionRefusedError):
                if self._near in ready:
                    packet, client = self._near.recvfrom(4096)
                    up += self.up.take(packet, now)
            with contextlib.suppress(ConnectionRefusedError):
                if self._far in ready:
                    down += self.down.take(self._far.recv(4096), now)
            for packet in up:
                with contextlib.suppress(ConnectionRefusedError):
                    self._far.send(packet)
            for packet in down:
                if client:
                    self._near.sendto(packet, client)

    def close(self) -> None:
        self._ended = True
        self._thread.join()
        self._near.close()
        self._far.close()

    def __enter__(self) -> "Lossy":
        return self

    def __exit__(self, *_) -> None:
        self.close()
