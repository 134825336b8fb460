"""The lossy path treats packets as it says."""

import contextlib
import socket
import time

from lossy import Lossy

PACKETS = 1000


def pass_through(source: socket.socket, sink: socket.socket, numbers: range) -> list[int]:
    """Sends numbered packets one after another, and returns the numbers that arrive."""
    arrived = []

    def collect() -> None:
        with contextlib.suppress(BlockingIOError):
            while True:
                arrived.append(int(sink.recv(64)))

    sink.setblocking(False)
    for number in numbers:
        source.send(str(number).encode())
        time.sleep(0.0002)
        collect()
    time.sleep(0.3)
    collect()
    return arrived


def check(numbers: range, arrived: list[int]) -> None:
    """Asserts a fifth each, within four standard deviations of so many draws."""
    share = len(numbers) / 5
    tolerance = 4 * (len(numbers) * 0.2 * 0.8) ** 0.5
    lost = len(set(numbers) - set(arrived))
    assert abs(lost - share) < tolerance, f"{lost} lost"
    left = len(numbers) - lost
    doubled = len(arrived) - len(set(arrived))
    assert abs(doubled - left / 5) < tolerance, f"{doubled} doubled"
    first = list(dict.fromkeys(arrived))
    overtaken = sum(later < earlier for earlier, later in zip(first, first[1:]))
    # One or several that wait leave together: with a fifth of n delayed, 0.8 · 0.2 · n are overtaken.
    assert abs(overtaken - left * 0.16) < tolerance, f"{overtaken} overtaken"


def test_a_fifth_is_lost_a_fifth_doubled_and_a_fifth_late_both_ways():
    fates = []
    for _ in range(2):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as esc:
            esc.bind(("127.0.0.1", 0))
            with (
                Lossy(esc.getsockname()[1], seed=1) as path,
                socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client,
            ):
                client.connect(("127.0.0.1", path.port))
                up = range(PACKETS)
                arrived = pass_through(client, esc, up)
                check(up, arrived)
                esc.connect(path.far_side)
                down = range(PACKETS, 2 * PACKETS)
                back = pass_through(esc, client, down)
                check(down, back)
                fates.append((set(arrived), set(back)))
    assert fates[0] == fates[1], "the same packets are lost each time"
    assert fates[0][0] != {number - PACKETS for number in fates[0][1]}, "each way has its own draw"
