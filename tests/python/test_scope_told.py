"""What the page tells a person: why something was refused, what state the ESC is in, what is known no more."""

import re
from xml.etree import ElementTree

from scope import browser, esc, give, look, port, spin  # noqa: F401  (fixtures)

SVG = "{http://www.w3.org/2000/svg}"
EVENTS = "document.querySelector('#events').textContent"


def inject(browser, kind):
    """Lets a fault happen, as it is offered."""
    browser.run(f"""
        document.querySelector('#fault').value = '{kind}';
        document.querySelector('#fault').dispatchEvent(new Event('change'));
        document.querySelector('#inject').click();
    """)


def test_a_refused_test_says_so_and_why_in_place_of_the_last_one_s_lines(browser, esc, port):
    look(browser, port)
    report = "document.querySelector('#report').textContent"
    browser.click("#self-test")
    browser.wait(f"/^supply .* ok$/m.test({report})")

    at = spin(browser, esc)
    browser.click("#self-test")
    browser.wait(f"{report} === 'Self-test: refused, the motor turns, or the throttle is open'")
    browser.click("#identify")
    browser.wait(f"{report} === 'Identification: refused, the motor turns'")

    inject(browser, "mosfet_short")
    browser.wait("document.querySelector('#tile-faults').textContent === 'over-current'")
    browser.click("#self-test")
    browser.wait(f"{report} === 'Self-test: refused, a fault holds: over-current'")
    assert "Self-test: refused, a fault holds" in browser.text("#events")
    browser.mouse("mouseReleased", *at)
    assert browser.problems == []


def fit(browser, bench):
    """Puts a bench of the library there, and waits until the ESC has been told."""
    browser.run("document.querySelector('#events').replaceChildren()")
    browser.run(f"document.querySelector('#bench').value = '{bench}'")
    browser.click("#fit")
    browser.wait(f"{EVENTS}.includes('The ESC knows this motor')")


def test_another_bench_leaves_nothing_of_the_one_before_and_is_named(browser, esc, port):
    look(browser, port)
    browser.wait("document.querySelector('#param-state').textContent.includes('parameters')")
    browser.wait("document.querySelector('#stands').textContent === 'Runs antigravity-4006-kv380 with cfprop-13x4.4'")
    # The board tests itself, and plays its tune.
    esc.next("HEARTBEAT", lambda m: m.system_status == 3)
    before = dict(esc.params())
    fit(browser, "scooter")
    assert browser.text("#stands") == "Runs scooter-hub with rider-90kg"
    assert "LIM_PHASE_A (its trip is beyond the current sensors' range)" in browser.text("#events")
    assert esc.read_param("CTL_OBSERVER").param_value == 2
    # Nothing that another page has to guess.
    browser.open(f"http://127.0.0.1:{port}/")
    browser.wait("/^Runs (?!antigravity)/.test(document.querySelector('#stands').textContent)")
    browser.wait("document.querySelector('#param-state').textContent.includes('parameters')")
    fit(browser, "bosso")
    assert "refused" not in browser.text("#events")
    after = dict(esc.params())
    assert {name: value for name, value in after.items() if value != before[name]} == {}
    assert browser.problems == []


def test_a_refused_parameter_is_named_with_the_reason(browser, esc, port):
    look(browser, port)
    browser.wait("document.querySelector('#param-state').textContent.includes('parameters')")
    browser.click("#show-parameters")
    browser.run("""{
        const input = document.querySelector('#param-LIM_PHASE_A');
        input.value = -5;
        input.dispatchEvent(new Event('change'));
    }""")
    row = "document.querySelector('#param-LIM_PHASE_A').closest('.param')"
    browser.wait(f"{row}.innerText.includes('LIM_PHASE_A: -5 was refused, out of range; give ')")
    assert browser.run("Number(document.querySelector('#param-LIM_PHASE_A').value)") > 0
    assert "LIM_PHASE_A: -5 was refused" in browser.text("#param-state")

    lines = "CTL_RPM_MAX 5000\nLIM_PHASE_A -5\nNO_SUCH 1\nMOT_DIR\n"
    give(browser, "#param-load", "some.param", lines)
    browser.wait("document.querySelector('#param-state').textContent === 'Loaded: 1 set, 0 as they were, 3 refused'")
    told = browser.run("[...document.querySelectorAll('#param-problems li')].map((line) => line.textContent)")
    assert told[:2] == ["line 3: there is no parameter NO_SUCH", "line 4: MOT_DIR is not NAME VALUE"]
    assert told[2].startswith("LIM_PHASE_A: -5 was refused, out of range; give ")
    assert browser.problems == []


def test_with_a_fault_nothing_looks_well_and_no_faded_estimate_is_a_speed(browser, esc, port):
    look(browser, port)
    spin(browser, esc)
    assert browser.text("#drive") == "run, armed"
    inject(browser, "mosfet_short")
    browser.wait("document.querySelector('#drive').textContent === 'idle, armed, fault'")
    assert browser.run("document.querySelector('#drive').classList.contains('bad')")
    assert not browser.run("document.querySelector('#drive').classList.contains('good')")
    # The shorted winding brakes the shaft within a fifth of a second, the estimate fades for seconds.
    esc.next("ESC_STATUS", lambda m: m.rpm[0] < 1500)
    assert esc.status().rpm[0] > 300
    assert browser.text("#tile-rpm + span") == "True rpm"
    assert abs(int(browser.text("#tile-rpm"))) < 150
    # A piece of the past does not tell what holds now.
    browser.click("#pause")
    browser.wait("document.querySelector('#tile-rpm + span').textContent === 'Speed unknown'")
    assert browser.text("#tile-faults") == "over-current"
    browser.click("#mend")
    browser.click("#stop")
    browser.wait("document.querySelector('#tile-faults').textContent === 'none'")
    browser.wait("document.querySelector('#drive').textContent === 'at rest'")
    assert browser.problems == []


def test_without_the_program_nothing_looks_live_and_nothing_can_be_pressed(browser, esc, port):
    look(browser, port)
    spin(browser, esc)
    esc.emulator.kill()
    browser.wait("document.querySelector('#state').textContent === 'not connected'")
    tiles = "[...document.querySelectorAll('#tiles b')].map((tile) => tile.textContent)"
    assert set(browser.run(tiles)) == {"–"}
    assert browser.text("#drive") == ""
    assert float(browser.run("getComputedStyle(document.querySelector('#plots')).opacity")) < 0.5
    can = "[...document.querySelectorAll('button, input, select')].filter((one) => one.matches(':enabled'))"
    left = browser.run(f"{can}.map((one) => one.id).filter((id) => id)")
    # What was seen can still be looked at, and saved.
    assert set(left) == {
        "show-scope", "show-parameters", "theme", "pause", "live", "span", "zoom-in", "zoom-out", "trigger",
        "trigger-channel", "trigger-value", "trigger-edge", "unmark", "export-svg", "export-png", "export-csv",
    }  # fmt: skip
    # It looks for its program, in vain.
    assert all("WebSocket" in problem for problem in browser.problems)
    browser.problems.clear()


def test_faults_are_read_out_and_stop_is_in_reach_on_a_phone(browser, esc, port):
    look(browser, port)
    live = "document.querySelector('#tile-faults').closest('[aria-live]')?.getAttribute('aria-live')"
    assert browser.run(live) == "assertive"
    try:
        browser.show(390, 700, dark=False)
        spin(browser, esc)
        browser.run("window.scrollTo(0, document.body.scrollHeight)")
        where = "(({top, bottom}) => [top, bottom, innerHeight])(document.querySelector('#stop-always').getBoundingClientRect())"
        top, bottom, height = browser.run(where)
        assert 0 < top < bottom <= height
        browser.click("#stop-always")
        esc.wait_rpm(-100, 1000)
        assert browser.text("#arm") == "Arm"
        browser.click("#show-parameters")
        assert browser.run("document.querySelector('#stop-always').checkVisibility()")
    finally:
        browser.show(1280, 900, dark=False)
    assert not browser.run("document.querySelector('#stop-always').checkVisibility()")
    assert browser.problems == []


def test_a_flat_signal_has_an_axis_in_its_unit(browser, esc, port):
    look(browser, port)
    browser.run("""
        window.files = [];
        const create = URL.createObjectURL;
        URL.createObjectURL = (blob) => { window.files.push(blob); return create(blob); };
    """)
    # At rest, with the brake, nothing flows.
    esc.next("HEARTBEAT", lambda m: m.system_status == 3)
    browser.run("new Promise((resolve) => setTimeout(resolve, 2500))")
    browser.click("#export-svg")
    browser.wait("window.files.length > 0")
    texts = [text.text for text in ElementTree.fromstring(browser.run("window.files[0].text()")).iter(SVG + "text")]
    least = {"Speed, rpm": 10, "Phase currents, A": 0.5, "Currents d, q, A": 0.5, "Throttle": 0.1}
    for name, span in least.items():
        # Its name is followed by the ends and the middle of its axis.
        low, _, high = map(float, texts[texts.index(name) + 1 :][:3])
        assert span <= high - low < 2 * span, name
    assert browser.problems == []


def test_bounds_are_a_pale_area_with_edges_and_read_as_bounds(browser, esc, port):
    look(browser, port)
    at = spin(browser, esc)
    # Two seconds at a steady speed, of which a column has some sixty periods.
    browser.run("new Promise((resolve) => setTimeout(resolve, 2500))")
    browser.click("#pause")
    browser.mouse("mouseReleased", *at)
    browser.run("""
        window.files = [];
        const create = URL.createObjectURL;
        URL.createObjectURL = (blob) => { window.files.push(blob); return create(blob); };
    """)
    # The middle of the phase currents' plot, where a line through the bounds is opaque.
    canvas = "document.querySelectorAll('#plots canvas')[1]"
    middle = f"{canvas}.getContext('2d').getImageData({canvas}.width * 0.6, {canvas}.height / 2 - 12, 60, 1).data"
    opaque = f"[...{middle}].filter((value, i) => i % 4 === 3 && value === 255).length"
    assert browser.run(opaque) < 6
    browser.click("#export-svg")
    browser.wait("window.files.length > 0")
    paths = list(ElementTree.fromstring(browser.run("window.files[0].text()")).iter(SVG + "path"))
    assert sum(path.get("fill-opacity") == "0.25" for path in paths) == 11
    # The legend at the cursor.
    box = browser.box("#plots .plot:nth-child(2) .u-over")
    browser.mouse("mouseMoved", box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    legend = "document.querySelector('#plots .plot:nth-child(2) .u-legend').textContent"
    browser.wait(f"/a-[23][.\\d]* … [23][.\\d]*b/.test({legend})")
    assert browser.problems == []


def test_after_arming_space_and_arrows_turn_the_motor_as_the_hint_says(browser, esc, port):
    look(browser, port)
    assert "in focus, which arming gives it" in browser.text("#throttle-hint")
    browser.click("#arm")
    browser.wait("document.querySelector('#drive').textContent.includes('armed')")
    esc.next("HEARTBEAT", lambda m: m.base_mode & 128)
    browser.key("keyDown", " ")
    for _ in range(10):
        browser.key("keyDown", "ArrowUp")
        browser.key("keyUp", "ArrowUp")
    assert browser.run("document.querySelector('#throttle').value") == "20"
    esc.wait_rpm(1000, 2000)
    browser.key("keyUp", " ")
    assert browser.run("document.querySelector('#throttle').value") == "0"
    esc.wait_rpm(-100, 600)
    assert browser.problems == []


def test_marks_are_cleared_and_a_zoom_has_its_span(browser, esc, port):
    look(browser, port)
    span = "document.querySelector('#span').selectedOptions[0]?.textContent"
    assert browser.run(span) == "2 s"
    # As long as the ESC has run there is something to look at.
    browser.run("new Promise((resolve) => setTimeout(resolve, 2500))")
    browser.click("#pause")
    box = browser.box("#plots .u-over")
    y = box["y"] + box["height"] / 2
    ends = [box["x"] + share * box["width"] for share in (0.25, 0.75)]
    for name, x in zip("ab", ends):
        browser.mouse("mouseMoved", x, y)
        browser.wait("document.querySelector('#plots .u-value').textContent !== '–'")
        browser.key("keyDown", name)
    assert re.fullmatch(r"A .* s, B .* s, B − A (99\d|100\d)\.\d+ ms, .* Hz", browser.text("#cursors"))
    browser.click("#unmark")
    assert browser.text("#cursors") == ""
    assert browser.run("document.querySelector('#unmark').hidden")

    browser.mouse("mousePressed", ends[0], y)
    browser.mouse("mouseMoved", ends[1], y)
    browser.mouse("mouseReleased", ends[1], y)
    browser.wait(f"/^(99\\d|1(\\.0\\d)?) (ms|s)$/.test({span})")
    browser.click("#zoom-in")
    browser.click("#zoom-in")
    browser.wait(f"/^2[45]\\d ms$/.test({span})")
    browser.run("document.querySelector('#span').value = 0.1; document.querySelector('#span').dispatchEvent(new Event('change'))")
    assert browser.run("document.querySelectorAll('#span .zoomed').length") == 0
    assert browser.problems == []
