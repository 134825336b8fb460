"""MAVLink endpoints: several clients, clients that come and go, noise on the line."""

import os
import random
import select
import socket
import termios
import time
import tty

import siskin_dialect as dialect
from emulator import free_port
from esc import Esc, gaps_us


def test_several_clients_see_the_same_esc_and_one_may_leave_and_come_back(start):
    emulator = start()
    clients = [emulator.connect() for _ in range(4)]
    # Each sees every answer: the first reads last, so that no old value comes after what it sets.
    for client in reversed(clients):
        assert client.read_param("MOT_STOP").param_value == 1.0
    clients.pop().close()
    clients[0].set_param("MOT_STOP", 0.0)
    for client in clients:
        # The answer to a read that was repeated may still come first.
        assert any(client.read_param("MOT_STOP").param_value == 0.0 for _ in range(3))
        client.next("HEARTBEAT")
    with emulator.connect() as back:
        assert back.read_param("MOT_STOP").param_value == 0.0
        back.next("HEARTBEAT")
    for client in clients:
        client.close()


def test_a_client_that_does_not_read_holds_up_no_other(start):
    emulator = start()
    request = dialect.MAVLink_param_request_list_message(1, 1).pack(dialect.MAVLink(None))
    with socket.socket() as deaf, emulator.connect() as esc:
        # Before the connection, so that its window is small from the start.
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1024)
        deaf.connect(("127.0.0.1", emulator.port))
        mark = esc.mark()
        until = time.monotonic() + 120.0
        dropped = False
        # The emulator drops a client that it can no longer send to: what it has for the other is still sent.
        while not dropped and time.monotonic() < until:
            try:
                for _ in range(10):
                    deaf.send(request)
                    time.sleep(0.001)
            except OSError:
                dropped = True
            esc.status()
        assert dropped, "the deaf client's socket never was full"
        esc.status()
        gaps = gaps_us(esc.since(mark, "ESC_STATUS"))
        assert max(gaps) < 200_000, "a status was left out"
        assert esc.read_param("MOT_STOP").param_value == 1.0


def test_udp_out_talks_to_a_ground_station_that_answers(start):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station:
        station.bind(("127.0.0.1", 0))
        station.settimeout(10.0)
        start("--mavlink", f"udpout:127.0.0.1:{station.getsockname()[1]}")
        _, sender = station.recvfrom(4096)
        station.connect(sender)
        with Esc(station.dup()) as esc:
            esc.next("HEARTBEAT")
            assert esc.read_param("MOT_STOP").param_value == 1.0


def test_udp_in_answers_whoever_has_called(start):
    port = free_port(socket.SOCK_DGRAM)
    start("--mavlink", f"udpin:127.0.0.1:{port}")
    with Esc.udp_to(port) as first, Esc.udp_to(port) as second:
        for esc in (first, second):
            esc.next("HEARTBEAT")
            assert esc.read_param("MOT_STOP").param_value == 1.0


def test_a_pty_is_a_serial_port(start, tmp_path):
    link = tmp_path / "ttyESC"
    start("--mavlink", f"pty:{link}:115200")
    assert link.is_symlink()
    until = time.monotonic() + 10.0
    port = os.open(link, os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(port, termios.TCSANOW)
        codec = dialect.MAVLink(None)
        codec.robust_parsing = True
        names = set()
        while "HEARTBEAT" not in names and time.monotonic() < until:
            if select.select([port], [], [], 0.2)[0]:
                names |= {m.get_type() for m in codec.parse_buffer(os.read(port, 4096)) or []}
        assert "HEARTBEAT" in names
    finally:
        os.close(port)


def frames(esc: Esc) -> list[bytes]:
    """Valid frames to corrupt; none changes anything."""
    codec = esc.codec
    messages = [
        dialect.MAVLink_param_request_read_message(1, 1, b"MOT_STOP", -1),
        dialect.MAVLink_param_request_list_message(1, 1),
        dialect.MAVLink_command_long_message(1, 1, 999, 0, 0, 0, 0, 0, 0, 0, 0),
        dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
    ]
    return [message.pack(codec) for message in messages]


def test_malformed_bytes_do_no_harm(esc):
    noise = random.Random(2)
    sound = frames(esc)
    for i in range(400):
        spoilt = bytearray(sound[i % len(sound)])
        match i % 5:
            case 0:  # A bit flipped anywhere.
                spoilt[noise.randrange(len(spoilt))] ^= 1 << noise.randrange(8)
            case 1:  # Cut short.
                del spoilt[noise.randrange(1, len(spoilt)) :]
            case 2:  # Noise with start bytes.
                spoilt = bytearray(noise.randbytes(40)) + b"\xfd\xfe" * 3
            case 3:  # A length that is too long, and unknown flags.
                spoilt[1:3] = b"\xff\xfe"
            case 4:  # An id that no dialect has.
                spoilt[7:10] = b"\xff\xff\xff"
        esc.write(bytes(spoilt))
    assert esc.read_param("MOT_STOP").param_value == 1.0
    assert esc.next("HEARTBEAT").system_status == dialect.MAV_STATE_STANDBY


def test_a_frame_that_comes_byte_by_byte_is_read(esc):
    mark = esc.mark()
    for byte in frames(esc)[0]:
        esc.write(bytes([byte]))
        time.sleep(0.002)
    assert esc.wait("PARAM_VALUE", lambda m: m.param_id == "MOT_STOP", mark) is not None


def test_mavlink_1_is_understood(esc):
    mark = esc.mark()
    request = dialect.MAVLink_param_request_read_message(1, 1, b"MOT_STOP", -1)
    esc.write(request.pack(esc.codec, force_mavlink1=True))
    assert esc.wait("PARAM_VALUE", lambda m: m.param_id == "MOT_STOP", mark) is not None


def test_a_signed_frame_is_not_obeyed_without_a_key(esc):
    signed = dialect.MAVLink(esc, srcSystem=255, srcComponent=190)
    signed.signing.secret_key = bytes(32)
    signed.signing.sign_outgoing = True
    signed.param_set_send(1, 1, b"MOT_STOP", 0.0, dialect.MAV_PARAM_TYPE_REAL32)
    time.sleep(0.3)
    assert esc.read_param("MOT_STOP").param_value == 1.0


def test_a_flood_of_requests_is_survived(esc):
    for _ in range(200):
        esc.codec.param_request_list_send(1, 1)
        esc.codec.command_long_send(1, 1, 999, 0, *[0.0] * 7)
    assert len(esc.params()) > 30
    esc.next("HEARTBEAT")
