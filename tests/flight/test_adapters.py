"""The adapters for ArduPilot and PX4, against packets as these document them; neither program is used."""

import json
import math
import socket
import struct
import threading
import time

import pytest
from pymavlink.dialects.v20 import common as mavlink

import ardupilot
import px4
from escs import Escs
from quadrotor import Quadrotor

RATE_HZ = 400


@pytest.fixture
def quadrotor():
    escs = Escs("--param", "CTL_MODE=2")
    yield Quadrotor(escs)
    escs.close()


def port_of(kind: int) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class ArduPilot:
    """What it sends and takes."""

    def __init__(self, port: int):
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.connect(("127.0.0.1", port))
        self.link.settimeout(5.0)
        self.count = 0

    def packet(self, us: float, magic: int = 18458) -> bytes:
        return struct.pack("<HHI16H", magic, RATE_HZ, self.count, *[round(us)] * 4, *[0] * 12)

    def step(self, us: float) -> dict:
        self.count += 1
        return self.ask(self.packet(us))

    def ask(self, packet: bytes) -> dict:
        self.link.send(packet)
        answer = self.link.recv(4096)
        assert answer.startswith(b"\n") and answer.endswith(b"\n")
        return json.loads(answer)


@pytest.fixture
def autopilot(quadrotor):
    port = port_of(socket.SOCK_DGRAM)
    server = threading.Thread(target=ardupilot.serve, args=(port, quadrotor), daemon=True)
    server.start()
    time.sleep(0.2)
    return ArduPilot(port)


def test_ardupilot_stands_then_climbs(autopilot):
    seen = autopilot.step(1000)
    assert seen["timestamp"] == pytest.approx(1 / RATE_HZ)
    for _ in range(RATE_HZ):
        stands = autopilot.step(1000)
    assert stands["timestamp"] == pytest.approx(1 + 1 / RATE_HZ)
    # It feels what holds it up, upwards: negative in its axes.
    assert stands["imu"]["accel_body"] == pytest.approx([0.0, 0.0, -9.80665], abs=1e-3)
    assert stands["imu"]["gyro"] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert stands["position"] == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)
    assert stands["motor"]["rpm"] == [0.0] * 4
    for _ in range(RATE_HZ):
        idles = autopilot.step(1100)
    assert all(1000 < rpm < 6000 for rpm in idles["motor"]["rpm"])
    assert idles["position"][2] == pytest.approx(0.0, abs=1e-3)
    for _ in range(RATE_HZ // 2):
        climbs = autopilot.step(1500)
    assert all(rpm > 11_000 for rpm in climbs["motor"]["rpm"])
    assert climbs["position"][2] < -0.1 and climbs["velocity"][2] < -0.5
    assert climbs["imu"]["accel_body"][2] < -9.8
    assert math.hypot(*climbs["quaternion"]) == pytest.approx(1.0)


def test_ardupilot_is_answered_again_and_alone(autopilot):
    first = autopilot.step(1000)
    assert autopilot.ask(autopilot.packet(1000)) == first, "a repeated packet"
    autopilot.count += 1
    for stranger in [autopilot.packet(1000, magic=18459), autopilot.packet(1000)[:-1], b""]:
        autopilot.link.send(stranger)
    assert autopilot.ask(autopilot.packet(1000))["timestamp"] == pytest.approx(2 / RATE_HZ)


def test_px4_is_sensed_and_climbs(quadrotor):
    own, its = socket.socketpair()
    server = threading.Thread(target=px4.Px4(its, quadrotor).serve, daemon=True)
    server.start()
    codec = mavlink.MAVLink(None, srcSystem=1)
    own.settimeout(5.0)
    sensed, gps = [], []

    def until(count: int) -> None:
        while len(sensed) < count:
            for message in codec.parse_buffer(own.recv(4096)) or []:
                (sensed if message.get_type() == "HIL_SENSOR" else gps).append(message)

    def flies(seconds: float, share: float, armed: bool) -> None:
        for _ in range(round(seconds * 250)):
            mode = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | (mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0)
            controls = [share] * 4 + [0.0] * 12
            packet = mavlink.MAVLink_hil_actuator_controls_message(sensed[-1].time_usec, controls, mode, 1).pack(codec)
            count = len(sensed)
            own.sendall(packet)
            until(count + 1)

    # Before it has outputs, time goes on without it.
    until(3)
    flies(1.0, 0.0, armed=False)
    stands = sensed[-1]
    between_us = [later.time_usec - earlier.time_usec for earlier, later in zip(sensed, sensed[1:])]
    assert set(between_us) == {4000}
    assert (stands.xacc, stands.yacc, stands.zacc) == pytest.approx((0.0, 0.0, -9.80665), abs=0.1)
    assert stands.fields_updated == 0x1FFF and stands.id == 0
    assert stands.zmag == pytest.approx(0.43, abs=0.01), "the earth's field points down in the north"
    flies(1.0, 0.1, armed=True)
    assert all(esc.rpm > 1000 for esc in quadrotor.escs.all)
    before = sensed[-1]
    flies(0.5, 0.5, armed=True)
    climbs = sensed[-1]
    assert climbs.abs_pressure < before.abs_pressure - 0.01
    assert gps[-1].alt > gps[0].alt and gps[-1].vd < -50
    assert 9 <= len(sensed) / len(gps) <= 41
    own.close()
    server.join(10.0)
    assert not server.is_alive()
