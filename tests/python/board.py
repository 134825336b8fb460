"""The flashed image on the virtual board, which plays scenarios like the emulator."""

import json
import subprocess
from pathlib import Path

from paths import IMAGES, VIRTUAL_BOARD

IMAGE = IMAGES / "b-g431b-esc1.elf"


def on_board(path: Path) -> dict:
    """Plays a scenario with the image; returns its summary."""
    command = [VIRTUAL_BOARD, IMAGE, "--storage", "none", "scenario", path, "--json"]
    ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300)
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)
