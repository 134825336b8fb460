"""ArduPilot's simulator flies the quadrotor, through its JSON interface.

    target/venv/bin/python tests/flight/ardupilot.py

Then `sim_vehicle.py -v ArduCopter --model JSON:127.0.0.1`, with motors 1 to 4 of a quadrotor X. It is tested against
the packets that ArduPilot documents, not with the program itself.
"""

import argparse
import json
import socket
import struct

from body import Body, flipped
from escs import Escs
from quadrotor import Quadrotor, value_of

OUTPUTS = struct.Struct("<HHI16H")
MAGIC = 18458
# Its motors are front right, rear left, front left, rear right.
ESC_OF_OUTPUT = (1, 2, 3, 0)


def serve(port: int, quadrotor: Quadrotor) -> None:
    """Answers each packet with the state one of its frames later. A repeated packet is answered again."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", port))
        last, answer = None, b""
        while True:
            packet, address = link.recvfrom(2048)
            if len(packet) != OUTPUTS.size:
                continue
            magic, rate_hz, count, *pulses = OUTPUTS.unpack(packet)
            if magic != MAGIC or rate_hz == 0:
                continue
            if count != last:
                frames = [(esc, 0, value_of(us)) for esc, us in zip(ESC_OF_OUTPUT, pulses)]
                quadrotor.advance(round(1e9 / rate_hz), frames)
                last, answer = count, state(quadrotor)
            link.sendto(answer, address)


def state(quadrotor: Quadrotor) -> bytes:
    """Returns the body in ArduPilot's axes: forward, right, down, and north, east, down."""
    body = quadrotor.body
    w, x, y, z = body.attitude
    seen = {
        "timestamp": quadrotor.escs.now_ns * 1e-9,
        "imu": {"gyro": flipped(body.rates), "accel_body": flipped(body.felt)},
        "position": flipped([*body.place[:2], body.place[2] - Body.STANDS]),
        "quaternion": [w, x, -y, -z],
        "velocity": flipped(body.speed),
        "motor": {"rpm": [quadrotor.escs.all[esc].reported_rpm for esc in ESC_OF_OUTPUT]},
    }
    return b"\n" + json.dumps(seen).encode() + b"\n"


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--port", type=int, default=9002, help="UDP port of this interface (9002)")
    port = words.parse_args().port
    escs = Escs("--param", "CTL_MODE=2")
    try:
        serve(port, Quadrotor(escs))
    finally:
        escs.close()


if __name__ == "__main__":
    main()
