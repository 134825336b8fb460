"""The page as its tests use it: opened, driven, and given files."""

import json

import pytest

from browser import Browser
from emulator import free_port

HOLD_RPM = 3150
"""Half throttle in the speed mode's range from 300 to 6000 rpm."""


@pytest.fixture(scope="module")
def browser():
    with Browser() as browser:
        yield browser


@pytest.fixture
def port():
    return free_port()


@pytest.fixture
def esc(start, port, browser):
    """An ESC with a page, as a MAVLink client sees it."""
    emulator = start(web=f"127.0.0.1:{port}")
    with emulator.connect() as esc:
        esc.emulator = emulator
        yield esc
        # A page left open would keep looking for its program.
        browser.open("about:blank")


def look(browser, port):
    """Opens the page and waits until it shows something."""
    browser.open(f"http://127.0.0.1:{port}/")
    browser.wait("document.querySelector('#state').textContent === 'connected'")
    browser.wait("/^-?\\d+$/.test(document.querySelector('#tile-rpm').textContent)")


def spin(browser, esc, escs=(0,), components=(1,)) -> tuple[float, float]:
    """Arms, and holds the throttle at its middle until the motor has that speed; returns where the mouse holds it.

    On a busy machine the page may fail for 200 ms to report that it is held, which means zero: whenever that happens
    it is taken again.
    """
    for _ in range(8):
        if browser.text("#arm") == "Arm":
            browser.click("#arm")
        browser.wait("document.querySelector('#drive').textContent.includes('armed')")
        for component in components:
            esc.next("HEARTBEAT", lambda m: m.get_srcComponent() == component and m.base_mode & 128)
        at = browser.press("#throttle", 0.5)
        if esc.wait("ESC_STATUS", lambda m: all(abs(m.rpm[i] - HOLD_RPM) < 60 for i in escs), esc.mark(), 5.0):
            return at
        browser.mouse("mouseReleased", *at)
    raise AssertionError(f"never at {HOLD_RPM} rpm: {browser.text('#events')}")


def play(browser, text):
    """Gives the page a scenario file."""
    give(browser, "#scenario", "some.toml", text)


def give(browser, field, name, text):
    """Gives a field of the page a file."""
    browser.run(f"""{{
        const files = new DataTransfer();
        files.items.add(new File([{json.dumps(text)}], {json.dumps(name)}));
        const input = document.querySelector({json.dumps(field)});
        input.files = files.files;
        input.dispatchEvent(new Event("change"));
    }}""")
