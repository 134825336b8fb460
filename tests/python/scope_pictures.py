"""Makes the page's pictures for the emulator's README, from a browser that drives a running emulator.

    target/venv/bin/python tests/python/scope_pictures.py [FOLDER]

With a folder all of them go there, light and dark, wide and narrow, to be looked at; without one, the README's are
made again, in `emulator/pictures`. They show what happens live, so no two are the same bit for bit.
"""

import sys
import time
from pathlib import Path

import paths

sys.path.insert(0, str(paths.DIALECT))

from browser import Browser  # noqa: E402  (it needs the dialect's folder)
from emulator import Emulator, free_port  # noqa: E402

SIZES = {"wide": (1280, 960), "narrow": (390, 1400)}
README = paths.ROOT / "emulator" / "pictures"


def hold(browser, share, rpm=0):
    """Holds the throttle until the motor is faster. A busy machine may let it go: then it is taken again."""
    for _ in range(8):
        if browser.text("#arm") == "Arm":
            browser.click("#arm")
        browser.wait("document.querySelector('#drive').textContent.includes('armed')")
        at = browser.press("#throttle", share)
        if rpm == 0 or reached(browser, rpm):
            return
        browser.mouse("mouseReleased", *at)
    raise AssertionError(f"never at {rpm} rpm")


def reached(browser, rpm):
    until = time.monotonic() + 8.0
    while time.monotonic() < until:
        if browser.run("Number(document.querySelector('#tile-rpm').textContent)") > rpm:
            return True
        time.sleep(0.02)
    return False


def span(browser, seconds):
    browser.run(f"document.querySelector('#span').value = {seconds}")
    browser.run("document.querySelector('#span').dispatchEvent(new Event('change'))")


def start(browser):
    browser.run("document.querySelector('#trigger').value = 'start'")
    browser.run("document.querySelector('#trigger').dispatchEvent(new Event('change'))")
    span(browser, 1)
    hold(browser, 0.4)
    browser.wait("document.querySelector('#pause').getAttribute('aria-pressed') === 'true'")


def flight(browser):
    span(browser, 0.01)
    hold(browser, 0.6, 3700)
    time.sleep(0.3)
    browser.click("#pause")


def fault(browser):
    hold(browser, 0.5, 3100)
    browser.run("document.querySelector('#trigger').value = 'fault'")
    browser.run("document.querySelector('#trigger').dispatchEvent(new Event('change'))")
    span(browser, 0.1)
    browser.run("document.querySelector('#fault').value = 'mosfet_short'")
    browser.run("document.querySelector('#fault').dispatchEvent(new Event('change'))")
    browser.click("#inject")
    browser.wait("document.querySelector('#tile-faults').textContent !== 'none'")
    browser.wait("document.querySelector('#pause').getAttribute('aria-pressed') === 'true'")


def identification(browser):
    browser.click("#identify")
    browser.wait("document.querySelector('#report').textContent.includes('MOT_')", timeout=60)


def parameters(browser):
    browser.click("#show-parameters")
    browser.wait("document.querySelectorAll('.param.changed').length > 0")


def switches(browser):
    span(browser, 0.01)
    hold(browser, 0.6, 3700)
    browser.run("document.querySelector('#switches').open = true")
    browser.wait("document.querySelectorAll('#switch-plots canvas').length === 3")
    browser.click("#pause")
    for name in ("plots", "cursors"):
        browser.run(f"document.querySelector('#{name}').hidden = true")


def several(browser):
    box = browser.box("#throttle-all")
    at = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    browser.mouse("mousePressed", *at)
    browser.mouse("mouseReleased", *at)
    hold(browser, 0.5, 3100)


SCENES = {scene.__name__: scene for scene in (start, flight, fault, identification, parameters, switches, several)}
OPTIONS = {"switches": ("--plant", "switching"), "several": ("--escs", 4)}
IN_README = {
    "start": ("wide", False), "flight": ("wide", False), "fault": ("wide", True), "identification": ("wide", False),
    "parameters": ("wide", True), "switches": ("wide", False), "several": ("narrow", True),
}
"""The size, and whether the dark scheme is shown."""


def pictures(name, looks):
    """Takes a scene in each look: its name, size and scheme."""
    port = free_port()
    emulator = Emulator(*OPTIONS.get(name, ()), web=f"127.0.0.1:{port}")
    try:
        with Browser() as browser:
            browser.show(*SIZES["wide"], dark=False)
            browser.open(f"http://127.0.0.1:{port}/")
            browser.wait("document.querySelector('#param-state').textContent.includes('parameters')")
            SCENES[name](browser)
            for look, size, dark in looks:
                browser.show(*SIZES[size], dark)
                browser.run("window.scrollTo(0, 0)")
                time.sleep(0.6)
                yield look, browser.picture()
            assert browser.problems == [], browser.problems
    finally:
        emulator.end()


def main():
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    for name in SCENES:
        if folder is None:
            looks = [(f"scope-{name}", *IN_README[name])]
        else:
            folder.mkdir(parents=True, exist_ok=True)
            looks = [
                (f"{name}-{size}-{'dark' if dark else 'light'}", size, dark)
                for size in SIZES
                for dark in (False, True)
            ]
        for look, png in pictures(name, looks):
            (folder or README).joinpath(f"{look}.png").write_bytes(png)
            print(f"{look}.png, {len(png)} bytes")


if __name__ == "__main__":
    main()
