"""The Python module: its ESCs are the emulator's, bit for bit."""

import json
import math
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import siskin
from dshot import BIDIRECTIONAL_DSHOT600, HALF, datagram, erpm, is_extended, reply
from emulator import Emulator, run
from lockstep import FOUR, MS, Lockstep, frame


@pytest.fixture
def four():
    """Four ESCs at half throttle."""
    emulator = siskin.Emulator("bosso", escs=4, bus="6s")
    return turning(emulator)


def turning(emulator: siskin.Emulator) -> siskin.Emulator:
    emulator.advance(0.4)
    assert all(esc.armed for esc in emulator.state)
    emulator.throttle[:] = 0.5
    emulator.advance(1.6)
    return emulator


def told(state) -> list[tuple]:
    """Returns a state's fields, as in the lockstep datagram."""
    return [
        (
            esc.rpm,
            esc.angle_turns,
            esc.torque_nm,
            esc.currents_a,
            esc.bus_a,
            esc.bus_v,
            esc.board_c,
            (esc.reported.rpm, esc.reported.bus_v, esc.reported.bus_a, esc.reported.temperature_c),
            esc.armed,
            siskin.PHASES.index(esc.phase),
            [(answer.asked_ns, answer.datagram) for answer in esc.replies],
        )
        for esc in state
    ]


def test_it_is_the_emulator_in_lockstep_bit_for_bit():
    seconds, change_at = 2.5, 1500
    served = Emulator(*FOUR, "--bench", "bosso", "--json", "--duration", seconds, speed="lockstep")
    client = Lockstep(served.signal_port)
    module = siskin.Emulator("bosso", escs=4, bus="6s", trace=True)
    gusts = [100.0 * esc for esc in range(4)]
    for step in range(round(seconds * 1000)):
        if step == 400:
            module.throttle[:] = 0.5
        if step == change_at:
            client.environment(supply_ohm=0.02, ambient_c=10.0, shafts=[(0.001, gust) for gust in gusts])
            module.environment(supply_ohm=0.02, ambient_c=10.0, torque_nm=0.001, wind_rpm=gusts)
        value = datagram(0 if step < 400 else HALF, BIDIRECTIONAL_DSHOT600)
        client.advance(MS, [frame(esc, 0, value) for esc in range(4)])
        module.advance(0.001)
        wanted = [
            (e.rpm, e.angle_turns, e.torque_nm, e.currents_a, e.bus_a, e.bus_v, e.board_c, e.reported, e.armed, e.phase)
            + (e.answers,)
            for e in client.state.escs
        ]
        assert told(module.state) == wanted, step
    client.close()
    assert served.process.wait(10) == 0
    escs = json.loads(served.output().splitlines()[-1])["escs"]
    assert module.trace_hashes == [esc["trace_hash"] for esc in escs]
    assert all(3000 < esc.rpm < 3200 and esc.replies for esc in module.state)


def test_how_time_is_cut_makes_no_difference(four):
    emulator = siskin.Emulator("bosso", escs=4, bus="6s")
    for cut in (0.0, 0.0001234, 0.0010001, 0.05, 0.3478765, 0.001):
        emulator.advance(cut)
    emulator.throttle = 0.5
    for _ in range(16):
        emulator.advance(0.0333)
        emulator.advance(0.0667)
    assert [esc.rpm for esc in emulator.state] == [esc.rpm for esc in four.state]
    assert emulator.time_s == four.time_s


def test_each_esc_has_its_throttle_and_answers(four):
    assert all(abs(esc.rpm - 3150) < 20 and esc.phase == "run" for esc in four.state)
    four.throttle[1] = None
    four.throttle[2:] = [0.4, 0.0]
    assert list(four.throttle) == [0.5, None, 0.4, 0.0]
    four.throttle = np.array([0.5, 0.5, 0.4, 0.0])
    four.throttle[-3] = None
    four.advance(1.0)
    speeds = [esc.rpm for esc in four.state]
    least, most = four.params["CTL_RPM_MIN"], four.params["CTL_RPM_MAX"]
    assert abs(speeds[0] - 3150) < 20 and abs(speeds[2] - (least + 0.4 * (most - least))) < 20
    assert max(map(abs, speeds[1::2])) < 100 and not four.state[1].armed
    answers = four.state[0].replies
    assert len(answers) == pytest.approx(1000, abs=1)
    told_rpm = [erpm(data) / 12 for answer in answers if not is_extended(data := reply(answer.datagram))]
    assert max(abs(rpm - 3150) for rpm in told_rpm) < 40
    assert "rpm=3150" in repr(four.state[0]).replace("rpm=3149", "rpm=3150").replace("rpm=3151", "rpm=3150")


def test_a_program_sends_frames_of_its_own():
    emulator = siskin.Emulator("bosso", escs=1)
    emulator.throttle[0] = None
    for value in [0] * 400 + [HALF] * 1600:
        emulator.send(0, datagram(value), after_s=0.0002)
        emulator.advance(0.001)
    assert abs(emulator.state[0].rpm - 3150) < 20
    with pytest.raises(siskin.Error, match="protocol 99 is unknown"):
        emulator.send(0, b"\x63\0\0")


@pytest.mark.parametrize(
    "attempt, said",
    [
        (lambda e: siskin.Emulator("bosso", escs=9), "9 ESCs; give 1 to 8"),
        (lambda e: siskin.Emulator("bosso", escs=-1), "-1 ESCs; give 1 to 8"),
        (lambda e: siskin.Emulator("bosso", wire="pwm"), "'pwm' is not a throttle signal; give one of servo, "),
        (lambda e: siskin.Emulator("bosso", amps=1), "unknown field"),
        (lambda e: siskin.Emulator("bosso", noise_a=-1.0), "bench.noise_a = -1 is out of range; give 0 to"),
        (lambda e: e.advance(-1.0), "-1 s are out of range; give 0 to"),
        (lambda e: e.advance(math.nan), "NaN s are out of range"),
        (lambda e: e.throttle.__setitem__(0, 1.5), "throttle = 1.5 is out of range; give 0 to 1, or None"),
        (lambda e: e.throttle.__setitem__(slice(None), [1.0]), "throttle: 1 values for 2 ESCs"),
        (lambda e: e.environment(supply_v=101.0), "voltage of the supply = 101 is out of range; give 0 to 100"),
        (lambda e: e.environment(torque_nm=[1.0]), "torque_nm: 1 values for 2 ESCs"),
        (lambda e: e.faults.inject(0, "mosfet_open"), "phase: "),
        (lambda e: e.record(), "nothing is recorded; create the emulator with record=True"),
        (lambda e: e.trace_hashes, "no trace is kept; create the emulator with trace=True"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_line(attempt, said):
    with pytest.raises(siskin.Error) as raised:
        attempt(siskin.Emulator("bosso", escs=2))
    assert said in str(raised.value) and "\n" not in str(raised.value)


def test_an_esc_that_is_not_there_is_an_index_error():
    emulator = siskin.Emulator("bosso", escs=2)
    for attempt in (lambda: emulator.throttle[2], lambda: emulator.faults[5], lambda: emulator.params.of(-3)):
        with pytest.raises(IndexError, match="there is no ESC [^;]*; give 0 to 1"):
            attempt()


def test_errors_are_the_program_s():
    for keys, options in [
        ({"bench": "nope"}, ["--bench", "nope"]),
        ({"bus": "99s"}, ["--bus", "99s"]),
        ({"motor": "none"}, ["--motor", "none"]),
    ]:
        with pytest.raises(siskin.Error) as raised:
            siskin.Emulator(**keys)
        ended = run(*options, "--mavlink", "none", "--duration", 0)
        assert ended.returncode == 2 and ended.stderr == f"siskin-emulator: {raised.value}\n"


@pytest.fixture
def unasked():
    """Python does not switch threads by itself: only when one lets others run."""
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)
    yield
    sys.setswitchinterval(before_s)


def test_other_threads_go_on(four, unasked):
    counted, done = 0, False

    def count():
        nonlocal counted
        while not done:
            counted += 1
            time.sleep(0.0005)

    thread = threading.Thread(target=count)
    thread.start()
    before = counted
    four.advance(5.0)
    meanwhile = counted - before
    done = True
    thread.join()
    assert meanwhile > 0


def test_emulators_on_threads_of_their_own_are_what_they_are_alone():
    def turned(seed: int) -> list[str]:
        emulator = siskin.Emulator("bosso", escs=2, seed=seed, trace=True)
        turning(emulator)
        return emulator.trace_hashes

    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(turned, range(4)))
    assert together == [turned(seed) for seed in range(4)]
    assert len({tuple(hashes) for hashes in together}) == 4
