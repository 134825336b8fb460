"""Both images of the first board on the virtual board: what each has, and what the other one has stored."""

import pytest
from dshot import BIDIRECTIONAL_DSHOT600, HALF, is_extended
from emulator import PATIENT
from paths import IMAGES, VIRTUAL_BOARD

import siskin_dialect as dialect

FLIGHT = IMAGES / "b-g431b-esc1.elf"
PAPERS = IMAGES / "b-g431b-esc1-papers.elf"
ACCEPTED = dialect.MAV_RESULT_ACCEPTED
REQUEST_MESSAGE = dialect.MAV_CMD_REQUEST_MESSAGE
STORAGE = dialect.MAV_CMD_PREFLIGHT_STORAGE


@pytest.fixture
def board(start, tmp_path):
    """Starts boards with the same storage, one after another."""
    return lambda image, *options: start(*options, program=(VIRTUAL_BOARD, image), storage=tmp_path / "flash.bin")


def spin(emulator, esc) -> None:
    """Turns the motor at half throttle and reads its replies."""
    with emulator.throttle(protocol=BIDIRECTIONAL_DSHOT600) as throttle:
        esc.wait_armed()
        throttle.value = HALF
        esc.wait_rpm(3000, 3300)
        since = len(throttle.answers)
        esc.next("ESC_STATUS")
        assert [data for data in throttle.replies(since) if not is_extended(data)]


@pytest.mark.parametrize(("image", "parts"), [(FLIGHT, "flight"), (PAPERS, "papers")])
def test_an_image_spins_replies_and_says_which_it_is(board, image, parts):
    emulator = board(image, *PATIENT)
    with emulator.connect() as esc:
        esc.next("HEARTBEAT")
        assert esc.command(REQUEST_MESSAGE, dialect.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == ACCEPTED
        version = esc.wait("AUTOPILOT_VERSION")
        assert bytes(version.middleware_custom_version).rstrip(b"\0") == parts.encode()
        spin(emulator, esc)


def test_the_flight_image_refuses_by_name_what_only_the_papers_have(board):
    with board(FLIGHT).connect() as esc:
        esc.next("HEARTBEAT")
        for name, value, now in [
            ("CTL_OBSERVER", 0, 3),
            ("CTL_OBSERVER", 1, 3),
            ("CTL_OBSERVER", 2, 3),
            ("CTL_REGULATOR", 0, 1),
            ("CTL_REGULATOR", 2, 1),
            ("CTL_SPEED", 1, 0),
            ("CTL_ADAPT_L", 1, 0),
            ("CTL_MODULATION", 1, 0),
        ]:
            mark = esc.mark()
            assert esc.set_param(name, value) == now
            told = esc.wait("STATUSTEXT", lambda m: m.text.startswith(name), since=mark)
            assert told and "not in this image" in told.text, told
        # What it has is accepted as ever.
        assert esc.set_param("CTL_SPEED", 2) == 2


def test_what_the_papers_image_has_stored_is_kept_and_not_in_force_in_flight(board):
    emulator = board(PAPERS, *PATIENT)
    with emulator.connect() as esc:
        esc.next("HEARTBEAT")
        assert esc.set_param("CTL_OBSERVER", 0) == 0
        assert esc.set_param("LIM_PHASE_A", 15) == 15
        assert esc.command(STORAGE, 1) == ACCEPTED
        spin(emulator, esc)
    emulator.kill()

    emulator = board(FLIGHT, *PATIENT)
    with emulator.connect() as esc:
        told = esc.wait("STATUSTEXT", lambda m: m.text == "CTL_OBSERVER 0: not in this image")
        assert told, "nothing is said of it"
        assert esc.read_param("CTL_OBSERVER").param_value == 0
        assert esc.read_param("LIM_PHASE_A").param_value == 15
        spin(emulator, esc)
        # It stays when other settings are stored.
        esc.wait("ESC_STATUS", lambda m: m.rpm[0] == 0, since=esc.mark(), timeout=20)
        assert esc.set_param("LIM_PHASE_A", 16) == 16
        assert esc.command(STORAGE, 1) == ACCEPTED
    emulator.kill()

    with board(PAPERS).connect() as esc:
        esc.next("HEARTBEAT")
        assert esc.read_param("CTL_OBSERVER").param_value == 0
        assert esc.read_param("LIM_PHASE_A").param_value == 16
