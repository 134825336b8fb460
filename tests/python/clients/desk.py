"""An ESC on a desk, with a flash of its own and one way for a client to reach it."""

import shutil
import time
from pathlib import Path
from socket import SOCK_DGRAM

from emulator import Emulator, free_port
from esc import TIMEOUT_S

WAYS = ("udp", "tcp", "pty")


class Desk:
    """Its addresses are as each client writes them; a restart may change them."""

    def __init__(self, start, way: str, folder: Path, *options: str, baud: int = 115_200):
        self._start, self._way, self._options = start, way, options
        self._flash = folder / "flash.bin"
        self._tty = folder / "ttyESC"
        self.baud = baud
        self.power_on()

    def power_on(self) -> None:
        self.port = free_port(SOCK_DGRAM)
        endpoint = {
            "udp": ("--mavlink", f"udpin:127.0.0.1:{self.port}"),
            "tcp": (),
            "pty": ("--mavlink", f"pty:{self._tty}:{self.baud}"),
        }
        self._emulator: Emulator = self._start(
            *self._options, *endpoint[self._way], storage=self._flash
        )
        if self._way == "tcp":
            self.port = self._emulator.port

    @property
    def pymavlink(self) -> str:
        """The address as pymavlink, and so MAVProxy, writes it."""
        addresses = {
            "udp": f"udpout:127.0.0.1:{self.port}",
            "tcp": f"tcp:127.0.0.1:{self.port}",
            "pty": str(self._tty),
        }
        return addresses[self._way]

    @property
    def mavsdk(self) -> str:
        """The address as MAVSDK writes it."""
        addresses = {
            "udp": f"udpout://127.0.0.1:{self.port}",
            "tcp": f"tcpout://127.0.0.1:{self.port}",
            "pty": f"serial://{self._tty}:{self.baud}",
        }
        return addresses[self._way]

    def params(self) -> dict[str, float]:
        """Returns the ESC's parameters, read by the tests' own client on a link of its own."""
        with self._emulator.connect(system=0, component=0) as esc:
            return esc.params()

    def power_cycle(self) -> None:
        """Cuts the power once the ESC has stored by itself what was set, and turns it on again."""
        params = self.params()
        until = time.monotonic() + TIMEOUT_S
        while self._stored() != params:
            assert time.monotonic() < until, "what was set is not stored"
            time.sleep(0.2)
        self._emulator.kill()
        self.power_on()

    def _stored(self) -> dict[str, float]:
        """Returns what the ESC would begin with if the power were cut now."""
        other = self._start(storage=shutil.copy(self._flash, self._flash.with_suffix(".copy")))
        with other.connect() as esc:
            params = esc.params()
        other.kill()
        return params
