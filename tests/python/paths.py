"""Where things are."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TARGET = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
PROGRAM = TARGET / "release" / "siskin-emulator"
TOOL = TARGET / "release" / "siskin"
VIRTUAL_BOARD = TARGET / "release" / "siskin-vboard"
DIALECT = TARGET / "python"
"""Folder of the generated dialect, `siskin_dialect.py`."""
SCENARIOS = ROOT / "tests" / "scenarios"
IMAGES = TARGET / "images"
"""The boards' images, as the test command makes them."""
IMAGE_REPORT = ROOT / "tests" / "image"
