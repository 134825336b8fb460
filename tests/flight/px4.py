"""PX4's simulation flies the quadrotor, through the MAVLink messages of its simulator interface.

    target/venv/bin/python tests/flight/px4.py

Then `make px4_sitl none_iris`, which connects to TCP 4560. It is tested against the messages that PX4 documents, not
with the program itself.
"""

import argparse
import random
import socket

from pymavlink.dialects.v20 import common as mavlink

from body import Body, flipped
from escs import Escs
from quadrotor import Quadrotor, value_of

# Its motors are front right, rear left, front left, rear right.
ESC_OF_OUTPUT = (1, 2, 3, 0)
STEP_NS = 1_000_000
SENSE_EVERY, GPS_EVERY = 4, 100
"""Steps from one message to the next."""
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED

LATITUDE, LONGITUDE, ALTITUDE_M = 47.397742, 8.545594, 488.0
METRES_PER_DEGREE = 111_320.0
# North, west and up, gauss.
FIELD = (0.215, -0.008, -0.43)
ALL_FIELDS = 0x1FFF
# PX4 takes constant values for a dead sensor's.
NOISE = {"gyro": 1e-3, "felt": 2e-2, "field": 1e-3, "pressure": 2e-2}


class Px4:
    """A connection of PX4 to this simulator."""

    def __init__(self, link: socket.socket, quadrotor: Quadrotor):
        self.link = link
        self.quadrotor = quadrotor
        self.codec = mavlink.MAVLink(self, srcSystem=1, srcComponent=51)
        self.codec.robust_parsing = True
        self.values = [0] * 4
        self.in_step = False
        self.draw = random.Random(1)

    def write(self, data: bytes) -> None:
        """Sends bytes; the codec sends through this."""
        self.link.sendall(data)

    def serve(self) -> None:
        """Serves until PX4 ends the connection."""
        step = 0
        while True:
            if step % SENSE_EVERY == 0:
                if step % GPS_EVERY == 0:
                    self.tell_gps()
                self.tell_sensors()
                if not self.listen():
                    return
            self.quadrotor.advance(STEP_NS, [(esc, 0, value) for esc, value in enumerate(self.values)])
            step += 1

    def listen(self) -> bool:
        """Takes the outputs that answer the sensors. Before PX4 has any, it gets a step's time for them.

        Returns False at the end of the connection.
        """
        self.link.settimeout(10.0 if self.in_step else SENSE_EVERY * STEP_NS * 1e-9)
        while True:
            try:
                data = self.link.recv(4096)
            except TimeoutError:
                if self.in_step:
                    raise
                return True
            if not data:
                return False
            for message in self.codec.parse_buffer(data) or []:
                if message.get_type() == "HIL_ACTUATOR_CONTROLS":
                    self.take(message)
                    return True

    def take(self, message) -> None:
        self.in_step = True
        for esc, share in zip(ESC_OF_OUTPUT, message.controls):
            # A share of the throttle; an armed motor at zero idles.
            self.values[esc] = value_of(1002.0 + 998.0 * max(0.0, share)) if message.mode & ARMED else 0

    def tell_sensors(self) -> None:
        body = self.quadrotor.body
        gyro = self.noisy(flipped(body.rates), "gyro")
        felt = self.noisy(flipped(body.felt), "felt")
        field = self.noisy(flipped(body.to_body(FIELD)), "field")
        height = ALTITUDE_M + body.place[2] - Body.STANDS
        (pressure,) = self.noisy([1013.25 * (1.0 - 2.25577e-5 * height) ** 5.25588], "pressure")
        self.codec.hil_sensor_send(
            self.quadrotor.escs.now_ns // 1000, *felt, *gyro, *field, pressure, 0.0, height, 25.0, ALL_FIELDS, 0
        )

    def tell_gps(self) -> None:
        body = self.quadrotor.body
        north, east, sinks = flipped(body.speed)
        scale = 1e7 / METRES_PER_DEGREE
        # East at this latitude.
        latitude, longitude = LATITUDE * 1e7 + body.place[0] * scale, LONGITUDE * 1e7 - body.place[1] * scale / 0.677
        altitude_mm = round(1e3 * (ALTITUDE_M + body.place[2] - Body.STANDS))
        ground_cm_s = round(100 * (north**2 + east**2) ** 0.5)
        self.codec.hil_gps_send(
            self.quadrotor.escs.now_ns // 1000, 3, round(latitude), round(longitude), altitude_mm, 30, 40, ground_cm_s,
            round(100 * north), round(100 * east), round(100 * sinks), 65535, 10,
        )

    def noisy(self, values: list[float], kind: str) -> list[float]:
        return [self.draw.gauss(value, NOISE[kind]) for value in values]


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--port", type=int, default=4560, help="TCP port of this interface (4560)")
    port = words.parse_args().port
    escs = Escs("--param", "CTL_MODE=2")
    try:
        with socket.create_server(("127.0.0.1", port)) as server:
            link, _ = server.accept()
            with link:
                Px4(link, Quadrotor(escs)).serve()
    finally:
        escs.close()


if __name__ == "__main__":
    main()
