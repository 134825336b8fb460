"""Generates a Python dialect from the message definitions that ship with the `mavlink` crate.

pymavlink's wheel lacks ESC_INFO (290) and ESC_STATUS (291). The crate that the control is built with has them, so
tests and control read the same definition.
"""

import json
import subprocess
import sys
from pathlib import Path

from pymavlink.generator import mavgen

ROOT = Path(__file__).resolve().parent.parent
NEEDED = ("ESC_INFO", "ESC_STATUS")


def definitions() -> Path:
    """Returns the path of ardupilotmega.xml in the source of the crate that Cargo.lock names."""
    command = ["cargo", "metadata", "--locked", "--format-version", "1"]
    text = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout
    crates = [p for p in json.loads(text)["packages"] if p["name"] == "mavlink"]
    for crate in crates:
        for path in Path(crate["manifest_path"]).parent.rglob("ardupilotmega.xml"):
            return path
    sys.exit("dialect.py: the source of the mavlink crate holds no ardupilotmega.xml")


def generate(module: Path) -> None:
    """Writes the dialect as one Python module, MAVLink 2."""
    module.parent.mkdir(parents=True, exist_ok=True)
    options = mavgen.Opts(
        output=str(module), wire_protocol="2.0", language="Python3", validate=False
    )
    mavgen.mavgen(options, [str(definitions())])
    text = module.read_text()
    for name in NEEDED:
        if f"MAVLINK_MSG_ID_{name} =" not in text:
            sys.exit(f"dialect.py: the definitions have no {name}")


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("use: dialect.py MODULE.py")
    generate(Path(sys.argv[1]))
