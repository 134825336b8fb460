"""`siskin scope`: the browser page, for an ESC on a MAVLink link."""

import http.client
import json
import os
import re
import signal
import subprocess
import time

import pytest

from browser import TIMEOUT_S, Browser
from emulator import free_port
from paths import TOOL

TURNING_RPM = 200
"""More than any estimate at rest."""


@pytest.fixture(scope="module")
def browser():
    with Browser() as browser:
        yield browser


@pytest.fixture
def served(start, browser):
    """An ESC on a link, as another MAVLink client sees it, and the address of its page."""
    emulator = start()
    connect = ("--connect", f"tcp:127.0.0.1:{emulator.port}")
    command = [str(TOOL), "scope", *connect, "--web", "127.0.0.1:0"]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        line = program.stdout.readline()
        found = re.fullmatch(r"open (http://127\.0\.0\.1:\d+/) in a browser; Ctrl-C ends it\n", line)
        assert found, line
        with emulator.connect() as esc:
            esc.emulator = emulator
            yield esc, found.group(1)
    finally:
        # A page left open would keep looking for its program.
        browser.open("about:blank")
        program.terminate()
        program.wait()
        program.stdout.close()


def look(browser, url):
    """Opens the page and waits until it shows something."""
    browser.open(url)
    browser.wait("document.querySelector('#state').textContent === 'connected'")
    browser.wait("/^-?\\d+$/.test(document.querySelector('#tile-rpm').textContent)")
    browser.wait("document.querySelector('#param-state').textContent.includes('parameters')")


def hold(browser, esc) -> tuple[float, float]:
    """Holds the motor test's button until the motor turns; returns where the mouse is.

    While the ESC is still testing itself it refuses, and is asked again.
    """
    browser.run("document.querySelector('#test-value').value = 100")
    for _ in range(8):
        mark = esc.mark()
        at = browser.press("#turn", 0.5)
        if esc.wait("ESC_STATUS", lambda m: m.rpm[0] > TURNING_RPM, mark, 5.0):
            return at
        browser.mouse("mouseReleased", *at)
    raise AssertionError(f"it does not turn: {browser.text('#events')}")


def shows(browser, selector):
    return browser.run(f"document.querySelector({json.dumps(selector)}).checkVisibility()")


def test_it_shows_what_the_link_carries_and_nothing_else(browser, served):
    esc, url = served
    look(browser, url)
    assert int(browser.text("#param-state").split()[0]) == len(esc.params())
    for selector in ("#motor-card", "#records", "#stream", "#self-test", "#identify"):
        assert shows(browser, selector), selector
    for selector in ("#throttle-card", "#lab", "#tile-efficiency", "#plane"):
        assert not shows(browser, selector), selector
    browser.wait("document.querySelector('#tile-limits').textContent === 'none'")
    assert browser.text("#tile-faults") == "none"
    assert browser.text("#drive") == "at rest"
    assert browser.problems == []


def test_the_motor_turns_while_the_button_is_held_and_its_trace_moves(browser, served):
    esc, url = served
    look(browser, url)
    browser.click("#stream")
    browser.wait("document.querySelector('#stream').getAttribute('aria-pressed') === 'true'")
    assert esc.read_param("TEL_SIGNALS").param_value == 511
    picture = "document.querySelector('#plots canvas').toDataURL()"
    first = browser.run(picture)
    browser.run("""
        const tile = document.querySelector('#tile-rpm');
        window.fastest = 0;
        const look = () => { window.fastest = Math.max(window.fastest, Number(tile.textContent)); };
        new MutationObserver(look).observe(tile, { childList: true, characterData: true, subtree: true });
    """)
    at = hold(browser, esc)
    # It turns for three seconds at most, however slow the browser is.
    browser.wait(f"window.fastest > {TURNING_RPM}")
    browser.wait(f"{picture} !== {first!r}")
    # With streamed currents there is a d-q plane.
    browser.wait("document.querySelector('#plane').checkVisibility()")
    browser.mouse("mouseReleased", *at)
    esc.wait_rpm(-100, 100)
    assert browser.problems == []


def test_what_is_traced_can_be_exported(browser, served):
    esc, url = served
    look(browser, url)
    browser.click("#stream")
    streamed = esc.next("NAMED_VALUE_FLOAT", lambda m: m.name == "i_q")
    assert streamed is not None
    browser.run("""
        window.files = [];
        const create = URL.createObjectURL;
        URL.createObjectURL = (blob) => { window.files.push(blob); return create(blob); };
    """)
    def exported():
        count = browser.run("window.files.length")
        browser.click("#export-csv")
        browser.wait(f"window.files.length > {count}")
        head, *rows = browser.run("window.files.at(-1).text()").splitlines()
        return head.split(","), [row.split(",") for row in rows]

    volts, until = [], time.monotonic() + TIMEOUT_S
    while len(volts) < 50:
        assert time.monotonic() < until, f"{len(volts)} values of the supply's voltage"
        head, rows = exported()
        # Rows of telemetry, before the stream began, have no current.
        rows = [row for row in rows if row[head.index("i_q_a")]]
        volts = [float(row[head.index("bus_v")]) for row in rows]
    times = [float(row[0]) for row in rows]
    assert times == sorted(times)
    # 50 Hz is the factory's.
    assert all(abs(later - earlier - 0.02) < 0.002 for earlier, later in zip(times, times[1:]))
    assert all(abs(value - 24.0) < 0.5 for value in volts)


def test_a_parameter_that_is_set_is_the_esc_s(browser, served):
    esc, url = served
    look(browser, url)
    browser.run("""
        const input = document.querySelector('#param-CTL_RPM_MAX');
        input.value = 5000;
        input.dispatchEvent(new Event('change'));
    """)
    browser.wait("document.querySelector('#param-CTL_RPM_MAX').closest('.param').classList.contains('changed')")
    assert esc.read_param("CTL_RPM_MAX").param_value == 5000
    # What another client sets shows on the page too.
    esc.set_param("CTL_RPM_MAX", 4500)
    browser.wait("document.querySelector('#param-CTL_RPM_MAX').value === '4500'")


def test_a_test_and_a_record_are_fetched(browser, served):
    esc, url = served
    look(browser, url)
    browser.click("#self-test")
    browser.wait("document.querySelector('#report').textContent.includes('supply')")
    browser.run("""
        window.files = [];
        const create = URL.createObjectURL;
        URL.createObjectURL = (blob) => { window.files.push(blob); return create(blob); };
    """)
    browser.click("#record-statistics-txt")
    browser.wait("window.files.length === 1")
    assert browser.run("window.files[0].text()").strip()
    browser.click("#record-faults-bin")
    browser.wait("window.files.length === 2")
    assert browser.run("window.files[1].size") > 0
    assert browser.problems == []


def test_closing_the_page_ends_the_test(served):
    esc, url = served
    # A page that is closed does not open again.
    with Browser() as browser:
        look(browser, url)
        hold(browser, esc)
        browser.process.kill()
        esc.wait_rpm(-100, 100)


def test_a_foreign_page_and_a_foreign_name_are_refused(served):
    _, url = served
    host = url.removeprefix("http://").rstrip("/")
    for headers, status in [
        ({"Host": host}, 200),
        ({"Host": f"rebound.example:{host.split(':')[1]}"}, 403),
        ({"Host": host, "Origin": "http://evil.example"}, 403),
    ]:
        connection = http.client.HTTPConnection(host, timeout=10)
        connection.request("GET", "/", headers=headers)
        assert connection.getresponse().status == status, headers
        connection.close()


def test_bad_addresses_are_one_line(served):
    esc, url = served
    port = free_port()
    for arguments, told in [
        (("--web", "nowhere"), "the port is missing"),
        (("--web", url.removeprefix("http://").rstrip("/")), "is taken; give another port"),
        (("--connect", f"tcp:127.0.0.1:{port}"), "start the emulator"),
    ]:
        connect = () if "--connect" in arguments else ("--connect", f"tcp:127.0.0.1:{esc.emulator.port}")
        ended = subprocess.run([str(TOOL), "scope", *connect, *arguments], capture_output=True, text=True, timeout=60)
        assert (ended.returncode, ended.stderr.count("\n")) == (2, 1), ended.stderr
        assert told in ended.stderr


def test_an_esc_that_falls_silent_does_not_look_live(browser, served):
    esc, url = served
    look(browser, url)
    process = esc.emulator.process
    os.kill(process.pid, signal.SIGSTOP)
    try:
        browser.wait("document.querySelector('#state').textContent === 'ESC silent'")
        assert browser.text("#tile-rpm") == "–"
        assert browser.run("document.querySelector('#turn').matches(':disabled')")
        assert browser.run("document.querySelector('#stream').matches(':disabled')")
    finally:
        os.kill(process.pid, signal.SIGCONT)
    browser.wait("document.querySelector('#state').textContent === 'connected'")
    assert browser.run("document.querySelector('#turn').matches(':enabled')")
    browser.wait("/^-?\\d+$/.test(document.querySelector('#tile-rpm').textContent)")
    assert browser.problems == []
