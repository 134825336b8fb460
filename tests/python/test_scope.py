"""The page in a browser: it shows the ESC, drives it while held, and is closed to others."""

import contextlib
import csv
import http.client
import re
import socket
import time
from xml.etree import ElementTree

import pytest

from browser import TIMEOUT_S, Browser
from dshot import HALF
from emulator import free_port, run
from scope import HOLD_RPM, browser, esc, look, play, port, spin  # noqa: F401  (fixtures)

UPGRADE = {
    "Upgrade": "websocket",
    "Connection": "Upgrade",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA==",
}


def test_it_loads_and_its_traces_move(browser, esc, port):
    look(browser, port)
    browser.wait("document.querySelector('#param-state').textContent.includes('parameters')")
    assert int(browser.text("#param-state").split()[0]) == len(esc.params())
    ends = "document.querySelectorAll('#plots canvas').length"
    assert browser.run(ends) == 6
    picture = "document.querySelector('#plots canvas').toDataURL()"
    first = browser.run(picture)
    browser.wait(f"{picture} !== {first!r}")
    assert browser.text("#tile-faults") == "none"
    assert browser.problems == []


def test_the_slider_spins_the_motor_while_it_is_held(browser, esc, port):
    look(browser, port)
    at = spin(browser, esc)
    shown = browser.run("Number(document.querySelector('#throttle').value)")
    told = esc.status().rpm[0]
    assert abs(told - (300 + shown / 100 * 5700)) < 30
    browser.wait(f"Math.abs(Number(document.querySelector('#tile-rpm').textContent) - {told}) < 30")

    browser.mouse("mouseReleased", *at)
    esc.wait_rpm(-100, 1000)
    assert browser.run("document.querySelector('#throttle').value") == "0"
    assert browser.problems == []


def test_an_injected_fault_shows_its_name(browser, esc, port):
    look(browser, port)
    spin(browser, esc)
    browser.run("""
        document.querySelector('#fault').value = 'bus_sag';
        document.querySelector('#fault').dispatchEvent(new Event('change'));
        document.querySelector('#fault-value').value = 16;
        const tile = document.querySelector('#tile-faults');
        window.shown = null;
        const begun = performance.now();
        new MutationObserver(() => {
            if (tile.textContent !== 'none') window.shown ??= [performance.now() - begun, tile.textContent];
        }).observe(tile, { childList: true, characterData: true, subtree: true });
        document.querySelector('#inject').click();
    """)
    browser.wait("window.shown !== null")
    took_ms, name = browser.run("window.shown")
    assert name == "bus under-voltage"
    assert took_ms < 500
    browser.wait("document.querySelector('#events').textContent.includes('under-voltage')")

    browser.click("#stop")
    browser.click("#mend")
    browser.wait("Number(document.querySelector('#tile-volts').textContent) > 23")
    assert browser.problems == []


def test_parameters_are_set_marked_and_searched(browser, esc, port):
    look(browser, port)
    browser.click("#show-parameters")
    browser.wait("document.querySelector('#param-CTL_RPM_MAX')?.value === '6000'")
    browser.run("""
        const input = document.querySelector('#param-CTL_RPM_MAX');
        input.value = 5000;
        input.dispatchEvent(new Event('change'));
    """)
    browser.wait("document.querySelector('#param-CTL_RPM_MAX').closest('.param').classList.contains('changed')")
    assert esc.read_param("CTL_RPM_MAX").param_value == 5000
    browser.run("""
        document.querySelector('#search').value = 'slew';
        document.querySelector('#search').dispatchEvent(new Event('input'));
    """)
    shown = "[...document.querySelectorAll('.param:not([hidden]) code')].map((code) => code.textContent)"
    assert "CTL_SLEW_RPM_S" in browser.run(shown)
    assert "CTL_RPM_MAX" not in browser.run(shown)


def test_identification_tells_what_it_has_found(browser, esc, port):
    look(browser, port)
    browser.wait("document.querySelector('#param-state').textContent.includes('parameters')")
    browser.click("#identify")
    browser.wait("document.querySelector('#report').textContent.includes('MOT_R_MOHM')", timeout=60)
    assert not browser.run("document.querySelector('#keep').disabled")


def test_a_piece_is_zoomed_to_and_exported(browser, esc, port):
    look(browser, port)
    spin(browser, esc)
    browser.run("""
        window.files = [];
        const create = URL.createObjectURL;
        URL.createObjectURL = (blob) => { window.files.push(blob); return create(blob); };
        const span = document.querySelector('#span');
        span.value = 0.01;
        span.dispatchEvent(new Event('change'));
        document.querySelector('#pause').click();
    """)
    time.sleep(0.5)
    for kind in ("csv", "svg", "png"):
        browser.click(f"#export-{kind}")
        browser.wait(f"window.files.length > {('csv', 'svg', 'png').index(kind)}")
    head, *rows = csv.reader(browser.run("window.files[0].text()").splitlines())
    assert head[:4] == ["t_s", "rpm", "rpm_est", "rpm_ref"]
    # Every control period of 10 ms at 24 kHz.
    times = [float(row[0]) for row in rows]
    assert abs(len(times) - 241) <= 1
    assert all(abs(b - a - 1 / 24000) < 2e-9 for a, b in zip(times, times[1:]))
    currents = [sum(float(row[head.index(name)]) for name in ("i_a_a", "i_b_a", "i_c_a")) for row in rows]
    assert max(map(abs, currents)) < 1e-3
    picture = ElementTree.fromstring(browser.run("window.files[1].text()"))
    paths = [path for path in picture.iter("{http://www.w3.org/2000/svg}path") if path.get("fill") == "none"]
    assert len(paths) == 11
    assert browser.run("window.files[2].type") == "image/png"
    assert browser.problems == []


def test_another_sender_on_the_wire_keeps_the_page_off_it(browser, esc, port):
    look(browser, port)
    with esc.emulator.throttle() as throttle:
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(HOLD_RPM - 60, HOLD_RPM + 60)
        browser.click("#arm")
        browser.wait("document.querySelector('#events').textContent.includes('another sender')")
        assert browser.run("document.querySelector('#throttle').disabled")
        assert abs(esc.status().rpm[0] - HOLD_RPM) < 60


def test_a_foreign_page_and_a_foreign_name_are_refused(esc, port):
    def status(path, **headers) -> int:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        connection.putrequest("GET", path, skip_host=True)
        for name, value in headers.items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        found = connection.getresponse().status
        connection.close()
        return found

    own, host = f"http://127.0.0.1:{port}", f"127.0.0.1:{port}"
    assert status("/", Host=host) == 200
    assert status("/", Host=f"localhost:{port}") == 200
    assert status("/socket", Host=host, Origin=own, **UPGRADE) == 101
    for path, headers in [
        ("/", {}),
        ("/", {"Host": f"rebound.example:{port}"}),
        ("/", {"Host": host, "Origin": "http://evil.example"}),
        ("/socket", {"Host": host, **UPGRADE}),
        ("/socket", {"Host": host, "Origin": "http://evil.example", **UPGRADE}),
        ("/socket", {"Host": host, "Origin": "null", **UPGRADE}),
        ("/socket", {"Host": f"rebound.example:{port}", "Origin": f"http://rebound.example:{port}", **UPGRADE}),
    ]:
        assert status(path, **headers) == 403, (path, headers)


def test_slow_requests_do_not_keep_the_page_from_others(esc, port):
    slow = [socket.create_connection(("127.0.0.1", port)) for _ in range(40)]
    ended, until = set(), time.monotonic() + 4.0
    while time.monotonic() < until:
        for one in slow:
            # A byte now and then, which is no reason to wait for long.
            with contextlib.suppress(OSError):
                one.send(b"G")
                one.settimeout(0.001)
                if one.recv(1) == b"":
                    ended.add(one)
        begun = time.monotonic()
        page = http.client.HTTPConnection("127.0.0.1", port, timeout=1.0)
        page.request("GET", "/scope.js")
        assert page.getresponse().status == 200
        page.close()
        assert time.monotonic() - begun < 0.8
        time.sleep(0.3)
    for one in slow:
        with contextlib.suppress(TimeoutError):
            one.settimeout(0.001)
            with contextlib.suppress(ConnectionError):
                one.recv(1000)
            ended.add(one)
    assert len(ended) == 40


def test_beyond_loopback_nothing_is_served_without_the_token(start, browser):
    port = free_port()
    emulator = start(web=f"0.0.0.0:{port}")
    page = http.client.HTTPConnection("127.0.0.1", port, timeout=10.0)
    for path in ("/", "/scope.js", "/parameters.json", "/uplot/uPlot.min.css"):
        page.request("GET", path)
        answer = page.getresponse()
        assert answer.status == 403 and "token" in answer.read().decode(), path
    url = re.search(r"http://0\.0\.0\.0:\d+/(\?token=[0-9a-f]+)", emulator.output())
    browser.open(f"http://127.0.0.1:{port}/{url[1]}")
    browser.wait("document.querySelector('#param-state').textContent.includes('parameters')")
    assert browser.problems == []
    browser.open("about:blank")


def test_a_port_that_was_named_and_is_taken_is_an_error(esc, port):
    wire = "udp:127.0.0.1:0"
    ended = run("--web", f"127.0.0.1:{port}", "--mavlink", "none", "--signal", wire, "--storage", "none")
    assert ended.returncode == 2
    assert re.fullmatch(rf"siskin-emulator: --web 127.0.0.1:{port}: port {port} is taken; .*\n", ended.stderr)


def test_closing_the_page_stops_the_motor(esc, port):
    # A page that is closed does not open again.
    with Browser() as browser:
        look(browser, port)
        spin(browser, esc)
        browser.leave()
        esc.wait_rpm(-100, 1000)
        esc.wait_armed(False)


def test_each_of_several_is_shown_and_driven_and_all_together(browser, start, port):
    emulator = start("--escs", 4, web=f"127.0.0.1:{port}")
    with emulator.connect(component=140) as esc:
        look(browser, port)
        assert browser.run("document.querySelectorAll('#fleet button').length") == 4
        browser.click("#fleet button:nth-child(3)")
        browser.wait("document.querySelector('#fleet [aria-pressed=true] b').textContent === 'ESC 3'")
        browser.wait("document.querySelector('#param-MAV_COMP_ID').value === '142'")
        spin(browser, esc, escs=[2], components=[142])
        status = esc.status()
        assert [abs(rpm) < 100 for rpm in status.rpm] == [True, True, False, True]
        # The third one's figures and its trace, not another's.
        browser.wait(f"Math.abs(Number(document.querySelector('#tile-rpm').textContent) - {HOLD_RPM}) < 60")
        shown = "Number.parseInt(document.querySelector('#fleet button:nth-child(3) .rpm').textContent)"
        browser.wait(f"Math.abs({shown} - {HOLD_RPM}) < 60")
        assert browser.text("#fleet button:first-child .rpm") == "0 rpm"

        browser.click("#stop")
        esc.next("ESC_STATUS", lambda m: max(m.rpm) < 100)
        box = browser.box("#throttle-all")
        at = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        browser.mouse("mousePressed", *at)
        browser.mouse("mouseReleased", *at)
        assert browser.run("document.querySelector('#throttle-all').checked")
        spin(browser, esc, escs=range(4), components=range(140, 144))
        browser.click("#stop")
        esc.next("ESC_STATUS", lambda m: max(m.rpm) < 100)
        assert browser.problems == []
        browser.open("about:blank")


@pytest.mark.parametrize("name", ["run.csv", "run.tlog"])
def test_what_is_recorded_can_be_fetched_while_it_is_recorded(browser, start, port, tmp_path, name):
    path = tmp_path / name
    start("--record", path, web=f"127.0.0.1:{port}")
    look(browser, port)
    assert browser.text("#recording") == f"{name} so far"
    fetched = "fetch(document.querySelector('#recording').href).then((answer) => answer.text())"
    until = time.monotonic() + TIMEOUT_S
    while not (text := browser.run(fetched)):
        # It is written in pieces.
        assert time.monotonic() < until
    if name == "run.csv":
        assert text.startswith("t_s,") and text.endswith("\n")
        columns = {row.count(",") for row in text.splitlines()}
        assert len(columns) == 1
    browser.open("about:blank")


def test_the_six_switches_of_a_period_are_shown(browser, start, port):
    emulator = start("--plant", "switching", web=f"127.0.0.1:{port}")
    with emulator.connect() as esc:
        look(browser, port)
        browser.run("document.querySelector('#switches').open = true")
        # At rest with the brake, the low sides are always on.
        browser.wait("document.querySelectorAll('#switch-times dd').length === 6")
        spin(browser, esc)
        edges = "[...document.querySelectorAll('#switch-times dd')].map((edges) => edges.textContent)"
        browser.wait(f"{edges}.every((edges) => /^(on|off) [0-9.]+, (on|off) [0-9.]+$/.test(edges))")
        browser.click("#pause")
        highs, lows = [], []
        for place, text in enumerate(browser.run(edges)):
            times = {word: float(at) for word, at in (part.split() for part in text.split(", "))}
            assert all(0.0 <= at <= 1e6 / 24000 for at in times.values()), text
            (lows if place % 2 else highs).append(times)
        # A high side is on within its low side's off time, half a microsecond apart.
        for high, low in zip(highs, lows):
            assert abs(high["on"] - low["off"] - 0.5) < 0.002 and abs(low["on"] - high["off"] - 0.5) < 0.002
        assert "as the plant was switched" in browser.text("#switch-text")
        assert browser.run("document.querySelectorAll('#switch-plots canvas').length") == 3
        assert browser.problems == []
        browser.open("about:blank")


def test_another_motor_takes_the_place_of_one_at_rest(browser, esc, port):
    look(browser, port)
    browser.wait("document.querySelector('#param-MOT_POLE_PAIRS')?.value === '12'")
    at = spin(browser, esc)
    browser.run("document.querySelector('#bench').value = 'quad-5-inch'")
    browser.run("document.querySelector('#fit').dispatchEvent(new Event('click'))")
    browser.wait("document.querySelector('#events').textContent.includes('the motor turns: stop it')")
    browser.mouse("mouseReleased", *at)
    browser.click("#stop")
    esc.next("ESC_STATUS", lambda m: m.rpm[0] == 0)

    refused = "[...document.querySelectorAll('#events li')].filter((line) => line.textContent.includes('stop it')).length"
    browser.run("document.querySelector('#events').replaceChildren()")
    until = time.monotonic() + TIMEOUT_S
    # The shaft still has some turns left when its speed can no longer be measured.
    while "The ESC knows this motor" not in browser.text("#events"):
        assert time.monotonic() < until, browser.text("#events")
        browser.click("#fit")
        browser.wait(f"{refused} > 0 || document.querySelector('#events').textContent.includes('The ESC knows')")
        browser.run("document.querySelectorAll('#events li').forEach((line) => line.textContent.includes('stop it') && line.remove())")
    # The board's sensors do not reach as far as that bench's.
    assert "refused LIM_PHASE_A" in browser.text("#events")
    assert esc.read_param("MOT_POLE_PAIRS").param_value == 7
    # A four-cell pack instead of 24 V.
    browser.wait("Number(document.querySelector('#tile-volts').textContent) < 18")
    assert browser.problems == []


SCENARIO = """
bench.duration_s = 4.0
signal = [
    { at_s = 0.0, throttle = 0.0 },
    { at_s = 1.0, throttle = 0.5, shape = "ramp", for_s = 0.5 },
    { at_s = 3.5, throttle = 0.0 },
]
fault = [{ at_s = 3.0, for_s = 0.3, kind = "bus_sag", value = 2.0 }]
window = [{ name = "steady", t0_s = 2.5, t1_s = 3.0 }]
expect = [
    { window = "steady", key = "rpm_mean", equals = 3150.0, within = 60.0 },
    { window = "run", key = "faults", equals = 0 },
    { window = "steady", key = "bus_v_mean", below = 20.0 },
]
"""


def test_a_scenario_is_played_on_what_runs(browser, esc, port):
    look(browser, port)
    events = "document.querySelector('#events').textContent"
    play(browser, "signal = [{ at_s = 0.0, rpm = 3000.0 }]")
    browser.wait(f"{events}.includes('goes past the wire')")
    play(browser, SCENARIO)
    esc.next("ESC_STATUS", lambda m: abs(m.rpm[0] - HOLD_RPM) < 60)
    esc.next("ESC_STATUS", lambda m: abs(m.voltage[0] - 22.0) < 0.3)
    browser.wait(f"{events}.includes('Scenario: over; 2 of 3 expectations held; no fault')")
    told = browser.text("#events")
    assert re.search(r"Held: steady\.rpm_mean is 31\d\d[.\d]*, wanted 3150 ± 60", told)
    assert "Held: run.faults is 0, wanted 0 ± 0" in told
    assert re.search(r"FAILED: steady\.bus_v_mean is 2[34][.\d]*, wanted below 20", told)
    esc.wait_rpm(-100, 1000)

    # Stopped by a person, it does not continue.
    play(browser, SCENARIO)
    esc.next("ESC_STATUS", lambda m: m.rpm[0] > 1000)
    browser.click("#stop")
    esc.wait_rpm(-100, 500)
    esc.wait_armed(False)
    assert "Scenario: stopped" in browser.text("#events")
    assert browser.problems == []
