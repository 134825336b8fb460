"""Simulated time under a client's control: the datagrams of emulator/LOCKSTEP.md, in Python and in C."""

import json
import math
import random
import struct
import subprocess
import time

import pytest

from dshot import BIDIRECTIONAL_DSHOT600, HALF, datagram, erpm, is_extended, reply
from emulator import Emulator
from lockstep import FOUR, MS, Lockstep, State, build_example, frame

STEPS = 2000


@pytest.fixture
def lockstep(start):
    """Makes a client of an emulator in lockstep."""
    clients = []

    def make(*options) -> Lockstep:
        emulator = start(*options, speed="lockstep")
        clients.append(Lockstep(emulator.signal_port))
        clients[-1].emulator = emulator
        return clients[-1]

    yield make
    for client in clients:
        client.close()


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    """The C example."""
    return build_example(tmp_path_factory.mktemp("c"))


def play(client: Lockstep, pause=lambda: None) -> tuple[list[State], int]:
    """Does what the example does; returns its states and their hash."""
    states = []
    for step in range(STEPS):
        pause()
        if step == STEPS // 2:
            gusts = [(0.0, 100.0 * esc) for esc in range(4)]
            states.append(client.environment(supply_ohm=0.02, ambient_c=10.0, shafts=gusts))
        value = datagram(0 if step < 400 else 1047, BIDIRECTIONAL_DSHOT600)
        states.append(client.advance(MS, [frame(esc, 10_000 * esc, value) for esc in range(4)]))
    hash = 0xCBF29CE484222325
    for byte in b"".join(state.raw for state in states):
        hash = (hash ^ byte) * 0x100000001B3 & (1 << 64) - 1
    return states, hash


def test_clients_in_c_and_in_python_agree_bit_for_bit_at_any_pace(lockstep, example):
    states, hash = play(lockstep(*FOUR))
    last = states[-1]
    assert last.time_ns == STEPS * MS and last.refused == 0 and last.left_out == 0
    assert all(abs(esc.rpm - 3149) < 10 for esc in last.escs), [esc.rpm for esc in last.escs]
    assert all(abs(esc.rpm - esc.reported[0]) < 30 for esc in last.escs)
    assert all(esc.faults == 0 and esc.armed and esc.phase == 5 for esc in last.escs)

    # The same with pauses, during which nothing may look at the wall clock.
    chance = random.Random(1)
    slow, slowly = play(lockstep(*FOUR), lambda: time.sleep(0.02 if chance.random() < 0.02 else 0.0))
    assert slowly == hash and slow[-1].raw == last.raw

    server = lockstep(*FOUR).emulator
    ended = subprocess.run([example, str(server.signal_port), str(STEPS)], capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr
    assert f"states {hash:016x}" in ended.stdout, f"{hash:016x}\n{ended.stdout}"


def test_replies_come_with_their_times(lockstep):
    client = lockstep(*FOUR)
    client.run_up([HALF] * 4)
    asked, told = [], []
    for _ in range(200):
        begun = client.state.time_ns
        client.throttle(1, [HALF] * 4)
        for index, esc in enumerate(client.state.escs):
            asked.append((index, begun + 10_000 * index))
            told += [(index, asked_ns, answer) for asked_ns, answer in esc.answers]
    # Each frame has its reply, the last one perhaps in the advance after the end.
    assert len(asked) - 4 <= len(told) <= len(asked)
    times = {(index, round(asked_ns, -2)) for index, asked_ns, _ in told}
    assert len({(i, round(t, -2)) for i, t in asked} - times) <= 4
    speeds = [erpm(reply(answer)) / 12 for _, _, answer in told if not is_extended(reply(answer))]
    assert speeds and all(abs(rpm - 3150) < 40 for rpm in speeds), speeds[:5]


def test_how_a_time_is_cut_makes_no_difference(lockstep):
    def truth(state: State):
        return [(e.rpm, e.angle_turns, e.currents_a, e.bus_v, e.reported, e.phase) for e in state.escs]

    coarse, fine = lockstep("--escs", 2, "--bus", "4s"), lockstep("--escs", 2, "--bus", "4s")
    for step in range(1200):
        frames = [frame(esc, 130_000, datagram(0 if step < 400 else HALF)) for esc in (0, 1)]
        coarse.advance(MS, frames)
        for part_ns in (130_000, 170_001, 699_999):
            offset = [f[:4] + struct.pack("<I", 0) + f[8:] for f in frames] if part_ns == 170_001 else []
            fine.advance(part_ns, offset)
        assert truth(coarse.state) == truth(fine.state), step
    assert coarse.state.escs[0].rpm > 100


def test_a_malformed_request_is_counted_and_not_obeyed(lockstep):
    client = lockstep("--escs", 2)
    client.run_up([HALF, HALF])
    before = client.state
    good = client.advance_bytes(MS, [frame(1, 0, datagram(HALF))])
    change = struct.pack("<BBBBI3d", 42, 1, 0, 0, before.sequence + 1, 1.0, 0.0, 25.0)
    malformed = [
        good[:1], good[:11], good[:-1], good + b"\0",
        good[:1] + b"\2" + good[2:],
        client.advance_bytes(1_000_000_001, []),
        client.advance_bytes(MS, [frame(2, 0, datagram(0))]),
        client.advance_bytes(MS, [frame(0, MS, datagram(0))]),
        client.advance_bytes(MS, [frame(0, 5, datagram(0)), frame(0, 4, datagram(0))]),
        client.advance_bytes(MS, [frame(0, 0, b"\x63\0\0")]),
        client.advance_bytes(MS, [frame(0, 0, b"")]),
        client.advance_bytes(MS, [frame(0, 0, datagram(0))] * 1025),
        change[:-1], change[:2] + b"\1" + change[3:], change[:3] + b"\1" + change[4:],
        change[:8] + struct.pack("<3d", -1.0, 0.0, 25.0), change[:8] + struct.pack("<3d", 1.0, float("inf"), 25.0),
    ]  # fmt: skip
    for count, request in enumerate(malformed, start=1):
        state = client.exchange(request)
        assert state.refused == count, request[:16]
        assert state.raw[:16] + state.raw[20:] == before.raw[:16] + before.raw[20:]
    chance = random.Random(7)
    for _ in range(2000):
        kind = chance.choice([41, 42, 43])
        client.link.send(bytes([kind]) + chance.randbytes(chance.randrange(80)))
        assert State(client.link.recv(65536)).time_ns == before.time_ns
    # A good one still is accepted.
    assert client.turn(good).time_ns == before.time_ns + MS
    assert "is malformed: it ends before its fields do" in client.emulator.output()


def test_what_is_doubled_late_or_out_of_order_does_nothing(lockstep):
    client = lockstep("--escs", 2)
    client.run_up([HALF, HALF])
    request = client.advance_bytes(MS, [frame(0, 0, datagram(HALF))])
    after = client.turn(request)
    for _ in range(3):
        assert client.exchange(request).raw == after.raw
    for ahead in (-400, -1, 0, 2, 3, 1 << 31):
        late = client.advance_bytes(MS, [], (after.sequence + ahead) % (1 << 32))
        assert client.exchange(late).raw == after.raw
    assert client.ask().raw == after.raw and after.refused == 0


def test_a_client_that_vanishes_leaves_time_standing(lockstep):
    client = lockstep("--escs", 2)
    client.run_up([HALF, HALF])
    before = client.state
    port = client.emulator.signal_port
    client.close()
    time.sleep(0.5)
    other = Lockstep(port)
    try:
        assert other.state.raw == before.raw, "time stands"
        # Nobody sends: the signal is lost 100 ms after the last frame, in simulated time.
        other.advance(95 * MS)
        assert all(esc.phase == 5 and esc.rpm > 2900 for esc in other.state.escs)
        other.throttle(400, [None, None])
        assert all(not esc.armed and esc.phase != 5 for esc in other.state.escs)
        # An open throttle does not turn them again.
        other.throttle(1000, [HALF, HALF])
        other.throttle(1000, [HALF, HALF])
        assert all(not esc.armed and abs(esc.rpm) < 1 for esc in other.state.escs), other.state.escs
    finally:
        other.close()


def test_the_escs_share_their_supply(lockstep):
    client = lockstep(*FOUR)
    rest_v = client.run_up([HALF] * 4).escs[0].bus_v
    client.throttle(300, [1400, 48, 0, 0])
    escs = client.state.escs
    assert len({esc.bus_v for esc in escs}) == 1
    client.environment(supply_v=24.0, supply_ohm=0.5)
    client.throttle(100, [1400, 48, 0, 0])
    escs = client.state.escs
    drawn_a = sum(esc.bus_a for esc in escs)
    assert drawn_a > 1.0 and rest_v > 24.0
    # The capacitors settle within a millisecond; what is left is current ripple.
    assert abs(24.0 - 0.5 * drawn_a - escs[3].bus_v) < 0.03 * drawn_a, (drawn_a, escs[3].bus_v)
    assert all(abs(esc.reported[1] - esc.bus_v) < 0.2 for esc in escs)


def test_the_environment_acts(lockstep):
    client = lockstep("--escs", 2)
    client.run_up([HALF, HALF])
    calm = client.throttle(300, [HALF, HALF]).escs[0].torque_nm
    client.environment(ambient_c=60.0, shafts=[(-0.02, 0.0), (0.0, 1500.0)])
    escs = client.throttle(1000, [HALF, HALF]).escs
    # The speed is held: the torque rises by what pulls at the shaft, and a propeller with c2 = 0.3 µNms² takes the
    # less, the less its speed against the wind. Ripple within a millisecond is a few mNm.
    speed, wind = (rpm * math.pi / 30 for rpm in (escs[1].rpm, 1500.0))
    eased = 0.3e-6 * (speed**2 - (speed - wind) ** 2)
    mean = [0.0, 0.0]
    for _ in range(100):
        for index, esc in enumerate(client.throttle(1, [HALF, HALF]).escs):
            mean[index] += esc.torque_nm / 100
    assert abs(mean[0] - calm - 0.02) < 0.004 and abs(calm - mean[1] - eased) < 0.004, (calm, mean, eased)
    assert 25.3 < escs[0].board_c < 40.0


def test_mavlink_goes_by_simulated_time(lockstep):
    client = lockstep(*FOUR, "--param", "TEL_RATE_HZ=10")
    with client.emulator.connect(component=140) as esc:
        time.sleep(0.5)
        assert esc.messages == []
        client.run_up([HALF, HALF, 0, 0])
        mark = esc.mark()
        for _ in range(20):
            client.throttle(100, [HALF, HALF, 0, 0])
            time.sleep(0.01)
        last = esc.wait("ESC_STATUS", lambda m: m.time_usec > 3_850_000, mark)
        assert last is not None
        statuses = esc.since(mark, "ESC_STATUS")
        assert 19 <= len(statuses) <= 21
        assert {m.get_srcComponent() for m in statuses} == {140}
        assert last.index == 0 and all(abs(rpm - wanted) < 32 for rpm, wanted in zip(last.rpm, [3150, 3150, 0, 0]))
        assert all(abs(volts - client.state.escs[0].bus_v) < 0.1 for volts in last.voltage)
        info = esc.since(mark, "ESC_INFO")[-1]
        assert (info.count, info.info) == (4, 0b1111) and max(info.temperature) < 4000
        beats = {m.get_srcComponent() for m in esc.since(mark, "HEARTBEAT")}
        assert beats == {140, 141, 142, 143}
        assert {m.get_srcSystem() for m in esc.since(mark, "HEARTBEAT")} == {1}


def test_the_end_counts_what_was_refused():
    emulator = Emulator("--json", "--duration", 0.002, speed="lockstep")
    client = Lockstep(emulator.signal_port)
    client.exchange(b"\x29")
    client.advance(2 * MS)
    client.close()
    assert emulator.process.wait(10) == 0
    summary = json.loads(emulator.output().splitlines()[-1])
    assert summary["rejected"]["lockstep_requests"] == 1
    assert abs(summary["sim_s"] - 0.002) < 1e-4
