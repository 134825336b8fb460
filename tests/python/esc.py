"""A ground station's side of a MAVLink link, with the generated dialect."""

import contextlib
import socket
import threading
import time

import siskin_dialect as dialect

TIMEOUT_S = 10.0
"""For anything that should happen at once: generous, because test machines are busy."""


def gaps_us(messages: list) -> list[int]:
    """Returns the times from each to the next, by the sender's clock."""
    times = [m.time_usec for m in messages]
    return [later - earlier for earlier, later in zip(times, times[1:])]


class Esc:
    """Talks to the ESC at the other end and keeps every message that it sends."""

    def __init__(self, link: socket.socket, system: int = 1, component: int = 1):
        self.system, self.component = system, component
        self.link = link
        link.settimeout(TIMEOUT_S)
        self.codec = dialect.MAVLink(self, srcSystem=255, srcComponent=190)
        self.codec.robust_parsing = True
        self.messages: list = []
        self._news = threading.Condition()
        self._ended = False
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @classmethod
    def tcp(cls, port: int, **address) -> "Esc":
        return cls(socket.create_connection(("127.0.0.1", port), timeout=TIMEOUT_S), **address)

    @classmethod
    def udp_to(cls, port: int, **address) -> "Esc":
        """Returns a client of `udpin:127.0.0.1:port`; its first message makes it known there."""
        link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        link.connect(("127.0.0.1", port))
        esc = cls(link, **address)
        esc.send_heartbeat()
        return esc

    def write(self, data: bytes) -> None:
        """Sends raw bytes; the codec sends through this."""
        self.link.sendall(data)

    def close(self) -> None:
        self._ended = True
        with contextlib.suppress(OSError):
            self.link.shutdown(socket.SHUT_RDWR)
        self._reader.join()
        self.link.close()

    def __enter__(self) -> "Esc":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def _read(self) -> None:
        while not self._ended:
            try:
                data = self.link.recv(4096)
            except TimeoutError:
                continue
            except OSError:
                return
            if not data:
                return
            found = self.codec.parse_buffer(data) or []
            with self._news:
                self.messages += found
                self._news.notify_all()

    def mark(self) -> int:
        """Returns a place in the stream; later messages have a higher one."""
        with self._news:
            return len(self.messages)

    def since(self, mark: int, kind: str) -> list:
        """Returns the messages of a kind that have come since the mark."""
        with self._news:
            return [m for m in self.messages[mark:] if m.get_type() == kind]

    def wait(self, kind: str, match=lambda _: True, since: int = 0, timeout: float = TIMEOUT_S):
        """Returns the first such message since the mark, or None if none comes in time."""
        until = time.monotonic() + timeout
        with self._news:
            seen = since
            while True:
                for message in self.messages[seen:]:
                    seen += 1
                    if message.get_type() == kind and match(message):
                        return message
                left = until - time.monotonic()
                if left <= 0:
                    return None
                self._news.wait(left)

    def next(self, kind: str, match=lambda _: True, timeout: float = TIMEOUT_S):
        """Returns the next such message from now on; fails the test if there is none."""
        message = self.wait(kind, match, self.mark(), timeout)
        assert message is not None, f"no such {kind} within {timeout} s"
        return message

    def send_heartbeat(self) -> None:
        self.codec.heartbeat_send(
            dialect.MAV_TYPE_GCS, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE
        )

    def params(self) -> dict[str, float]:
        """Returns the whole table, in index order."""
        mark = self.mark()
        self.codec.param_request_list_send(self.system, self.component)
        first = self.wait("PARAM_VALUE", since=mark)
        assert first is not None, "no answer to PARAM_REQUEST_LIST"
        until = time.monotonic() + TIMEOUT_S
        while True:
            values = {m.param_index: m for m in self.since(mark, "PARAM_VALUE")}
            if len(values) == first.param_count:
                return {values[i].param_id: values[i].param_value for i in sorted(values)}
            assert time.monotonic() < until, f"{len(values)} of {first.param_count} parameters"
            time.sleep(0.02)

    def read_param(self, name: str = "", index: int = -1):
        """Returns the PARAM_VALUE for a name or an index."""
        mark = self.mark()
        self.codec.param_request_read_send(self.system, self.component, name.encode(), index)
        return self.wait(
            "PARAM_VALUE", lambda m: name == m.param_id or index == m.param_index, mark
        )

    def set_param(self, name: str, value: float) -> float:
        """Sends PARAM_SET and returns the value in force afterwards, from the PARAM_VALUE."""
        mark = self.mark()
        self.codec.param_set_send(
            self.system, self.component, name.encode(), value, dialect.MAV_PARAM_TYPE_REAL32
        )
        answer = self.wait("PARAM_VALUE", lambda m: m.param_id == name, mark)
        assert answer is not None, f"no PARAM_VALUE after PARAM_SET {name}"
        return answer.param_value

    def command(self, number: int, *params: float, confirmation: int = 0) -> int:
        """Sends COMMAND_LONG and returns the result in its ACK."""
        params = (*params, *[0.0] * (7 - len(params)))
        mark = self.mark()
        self.codec.command_long_send(self.system, self.component, number, confirmation, *params)
        ack = self.wait("COMMAND_ACK", lambda m: m.command == number, mark)
        assert ack is not None, f"no ACK of command {number}"
        return ack.result

    def stream(self, message: int, interval_us: int) -> None:
        """Requests a message at a rate."""
        result = self.command(dialect.MAV_CMD_SET_MESSAGE_INTERVAL, message, interval_us)
        assert result == dialect.MAV_RESULT_ACCEPTED

    def status(self):
        """Returns the next ESC_STATUS."""
        return self.next("ESC_STATUS")

    def statuses(self, seconds: float) -> list:
        """Returns the ESC_STATUS messages from now on, for this many simulated seconds."""
        mark = self.mark()
        begin = self.status().time_usec
        self.next(
            "ESC_STATUS",
            lambda m: m.time_usec >= begin + seconds * 1e6,
            timeout=4 * seconds + TIMEOUT_S,
        )
        return self.since(mark, "ESC_STATUS")

    def armed(self) -> bool:
        """Returns whether the next heartbeat says so."""
        return bool(self.next("HEARTBEAT").base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED)

    def wait_armed(self, armed: bool = True) -> None:
        """Waits until a heartbeat says so."""
        flag = dialect.MAV_MODE_FLAG_SAFETY_ARMED
        self.next("HEARTBEAT", lambda m: bool(m.base_mode & flag) == armed)

    def wait_rpm(self, low: float, high: float):
        """Returns the first ESC_STATUS from now on with a speed in this range."""
        return self.next("ESC_STATUS", lambda m: low <= m.rpm[0] <= high)
