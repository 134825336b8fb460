"""MAVLink without sockets."""

from __future__ import annotations

from typing import Any

from ._siskin import Laboratory


class MavlinkPipe:
    """The MAVLink stream of the ESCs: a write goes to all of them, a read returns what they send.

    pymavlink's ``MAVLink`` accepts it as the file to send to; :meth:`connection` returns a connection of its
    ``mavutil``. The ESCs' latest 64 KB are kept to be read, in whole frames.
    """

    def __init__(self, laboratory: Laboratory) -> None:
        self._laboratory = laboratory

    def write(self, data: bytes) -> int:
        """Sends bytes to the ESCs; returns their number."""
        self._laboratory.receive(bytes(data))
        return len(data)

    def read(self, size: int = -1) -> bytes:
        """Returns what the ESCs have sent, at most ``size`` bytes; never waits."""
        return self._laboratory.take_sent(size if size >= 0 else 1 << 32)

    def connection(self, *, dialect: str = "ardupilotmega", source_system: int = 255, step_s: float = 0.01) -> Any:
        """Returns a ``mavutil.mavfile`` on this pipe, for code written for pymavlink.

        While it waits for a message, simulated time advances by ``step_s`` at a time. Bytes not read until now are
        dropped.

        :raises ImportError: without pymavlink: ``pip install pymavlink``.
        """
        from pymavlink import mavutil

        if dialect != mavutil.current_dialect:
            mavutil.set_dialect(dialect)
        pipe, laboratory = self, self._laboratory
        pipe.read()

        class Connection(mavutil.mavfile):  # type: ignore[misc]
            def __init__(self) -> None:
                super().__init__(None, "siskin", source_system=source_system)

            def recv(self, n: int | None = None) -> bytes:
                return pipe.read(self.mav.bytes_needed() if n is None else n)

            def write(self, buf: bytes) -> None:
                pipe.write(buf)

            def select(self, timeout: float) -> bool:
                laboratory.advance(step_s)
                return True

        return Connection()
