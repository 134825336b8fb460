"""`siskin identify` against the emulator."""

import json
import subprocess

from emulator import Emulator
from paths import TOOL

FOUND = ["MOT_R_MOHM", "MOT_L_UH", "MOT_FLUX_MWB", "MOT_J_GCM2"]
# Nothing is known about the motor, whatever the bench states.
UNKNOWN = [word for name in FOUND for word in ("--param", f"{name}=0")]


def siskin(emulator: Emulator, *arguments: str) -> subprocess.CompletedProcess:
    command = [str(TOOL), "--connect", f"tcp:127.0.0.1:{emulator.port}", *arguments]
    return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)


def values(emulator: Emulator) -> list[float]:
    with emulator.connect() as esc:
        return [esc.read_param(name).param_value for name in FOUND]


def test_what_is_found_is_shown_and_set_only_when_it_is_to_be_kept(start, tmp_path):
    storage = tmp_path / "storage"
    emulator = start(storage=storage)
    with emulator.connect() as esc:
        for name in FOUND:
            esc.set_param(name, 0.0)
    ended = siskin(emulator, "identify", "--json")
    assert ended.returncode == 0, ended.stderr
    figures = {figure["name"]: figure for figure in json.loads(ended.stdout)["items"]}
    assert list(figures)[:4] == FOUND
    # The first paper's bench, within what identification promises.
    for name, truth, share in zip(FOUND, [108.0, 30.6, 1.3, 1430.0], [0.03, 0.05, 0.02, 0.1]):
        assert abs(figures[name]["value"] / truth - 1) < share, figures[name]
    # 500 ns is the factory's.
    assert abs(figures["dead_time"]["value"] / 500 - 1) < 0.1
    for figure in figures.values():
        assert set(figure) == {"name", "value", "unit", "confidence", "kept"}
        assert 0.9 < figure["confidence"] <= 1 and figure["kept"] is False
    assert values(emulator) == [0.0] * 4
    with emulator.connect() as esc:
        esc.wait_rpm(-1, 1)
    ended = siskin(emulator, "identify", "--keep", "--json")
    assert ended.returncode == 0, ended.stderr
    again = json.loads(ended.stdout)["items"]
    assert [figure["name"] for figure in again] == list(figures)
    assert [figure["name"] for figure in again if figure["kept"]] == FOUND
    kept = values(emulator)
    assert all(value > 0 for value in kept)
    emulator.kill()
    again = start(storage=storage)
    assert values(again) == kept


def test_what_ends_it_is_told_in_one_line(start):
    # A blocked shaft turns at no throttle.
    emulator = start(*UNKNOWN, "--fault", 'kind = "rotor_blocked"')
    ended = siskin(emulator, "identify", "--keep")
    assert ended.returncode == 1 and ended.stdout == ""
    assert len(ended.stderr.splitlines()) == 1 and "Not identified: " in ended.stderr
    assert values(emulator) == [0.0] * 4

    emulator = start("--bus", "8")
    with emulator.connect() as esc:
        esc.wait("HEARTBEAT", lambda beat: beat.system_status == 5)
    ended = siskin(emulator, "identify")
    assert ended.returncode == 1 and "not now" in ended.stderr
