"""What the page tells a person: why something was refused, what state the ESC is in, what is known no more."""

from scope import browser, esc, look, port, spin  # noqa: F401  (fixtures)

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
