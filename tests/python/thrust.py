"""Thrust: the time from idle to nine tenths of full speed, next to the shortest that limits and supply allow.

    target/venv/bin/python tests/python/thrust.py quad-5-inch quad-7-inch

prints a row for each bench: the shortest time, the field-oriented drive's and the six-step drive's, which runs at
60 kHz PWM, and may still be too slow for the motor.
"""

import csv
import json
import math
import sys
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path

import paths

sys.path.insert(0, str(paths.DIALECT))

from emulator import run  # noqa: E402  (it needs the dialect's folder)
from motors import FROM_MOTOR, toml  # noqa: E402

PROPELLERS = [
    "bosso", "whoop", "quad-3-inch", "quad-5-inch", "quad-7-inch", "quad-10-inch", "quad-15-inch", "cinelifter",
    "lift-28-inch", "ducted-fan", "helicopter",
]  # fmt: skip
FIELD_ORIENTED, SIX_STEP = 0, 1
IDLE, PUNCH_S, END_S = 0.055, 2.5, 5.5
SHARE = 0.9
STEP_S = 1e-5


@dataclass(frozen=True)
class Punch:
    """A throttle that jumps from idle to full."""

    from_rpm: float
    to_rpm: float
    """Nine tenths of full speed."""
    rest_v: float
    """Of the supply, without load."""
    took_s: float | None
    """None if it was never reached."""


def bench(name: str) -> dict:
    """Returns the tables of a bench in the library."""
    return tomllib.loads((paths.ROOT / "emulator" / "library" / f"{name}.toml").read_text())


def punched(folder: Path, name: str, drive: int) -> Punch | None:
    """Plays it, with the settings that follow from the motor; None if the motor is too fast for the drive."""
    full_rpm = bench(name)["params"].get("CTL_RPM_MAX", 6000)
    params = dict.fromkeys(FROM_MOTOR, 0) | {"CTL_DRIVE": drive}
    if drive == SIX_STEP:
        # It needs 24 periods per turn.
        params |= {"PWM_FREQ_HZ": 60_000}
    signals = [(0.0, 0.0), (0.5, IDLE), (PUNCH_S, 1.0)]
    file, record = folder / "punch.toml", folder / "punch.csv"
    tables = [f"[bench]\n{toml({'base': name, 'duration_s': END_S})}", f"[params]\n{toml(params)}"]
    tables += [f"[[signal]]\n{toml({'at_s': at_s, 'throttle': share})}" for at_s, share in signals]
    file.write_text("\n".join(tables))
    ended = run("scenario", file, "--json", "--record", record)
    if "too few periods" in ended.stderr:
        return None
    assert ended.returncode == 0, ended.stderr
    told = json.loads(ended.stdout)
    assert told["faults"] + told.get("warnings", []) == [], ended.stdout
    from_rpm, rest_v, took_s = 0.0, None, None
    with record.open() as rows:
        for row in csv.DictReader(rows):
            at_s, rpm = float(row["t_s"]), float(row["rpm"])
            rest_v = rest_v or float(row["bus_v"])
            if at_s < PUNCH_S:
                from_rpm = rpm
            elif rpm >= SHARE * full_rpm:
                took_s = at_s - PUNCH_S
                break
    return Punch(from_rpm, SHARE * full_rpm, rest_v, took_s)


def supply_ohm(bus: float | dict) -> float:
    return 0.0 if isinstance(bus, (int, float)) else 1e-3 * bus["resistance_mohm"]


def least_s(tables: dict, punch: Punch) -> float:
    """Returns the shortest time that limits and supply allow, with no current along d.

    J*dw/dt is the torque of the largest current along q minus the load. That current is LIM_PHASE_A, or what the
    supply voltage, or LIM_BUS_A, leaves.
    """
    motor, load, params = tables["bench"]["motor"], tables["bench"]["load"], tables["params"]
    inductance_h = motor.get("L_q", motor.get("L"))
    pairs, flux_wb, resistance_ohm = motor["pole_pairs"], motor["flux"], motor["R"]
    limit_a, bus_limit_a = params.get("LIM_PHASE_A", 20), params.get("LIM_BUS_A", 30)
    source_ohm = supply_ohm(tables["bench"]["bus"])
    rad_s, passed_s = punch.from_rpm * math.tau / 60, 0.0
    while rad_s < punch.to_rpm * math.tau / 60:
        electric = pairs * rad_s

        def allowed(i_q: float) -> bool:
            v_q, v_d = resistance_ohm * i_q + electric * flux_wb, electric * inductance_h * i_q
            power_w = 1.5 * v_q * i_q
            # The bus sags with the current that the power draws from it.
            root = punch.rest_v**2 - 4 * source_ohm * power_w
            if root <= 0:
                return False
            bus_v = (punch.rest_v + math.sqrt(root)) / 2
            return math.hypot(v_q, v_d) <= bus_v / math.sqrt(3) and power_w / bus_v <= bus_limit_a

        i_q = limit_a
        if not allowed(i_q):
            low, high = 0.0, limit_a
            for _ in range(20):
                middle = (low + high) / 2
                low, high = (middle, high) if allowed(middle) else (low, middle)
            i_q = low
        drag = load.get("c1", 0.0) * rad_s + load["c2"] * rad_s**2
        friction_nm = motor.get("friction_nm", 0.0) + load.get("torque_nm", 0.0)
        torque_nm = 1.5 * pairs * flux_wb * i_q - drag - friction_nm
        if torque_nm <= 0:
            return math.inf
        rad_s += torque_nm / (motor["J"] + load.get("J", 0.0)) * STEP_S
        passed_s += STEP_S
    return passed_s


def main() -> int:
    names = sys.argv[1:] or PROPELLERS
    print(f"{'bench':<14} {'from rpm':>8} {'to rpm':>7} {'least ms':>8} {'FOC ms':>7} {'ratio':>5} {'six-step ms':>11}")
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            punch = punched(Path(folder), name, FIELD_ORIENTED)
            six_step = punched(Path(folder), name, SIX_STEP)
        least = least_s(bench(name), punch)
        took_s = punch.took_s or math.inf
        figures = f"{1e3 * least:>8.0f} {1e3 * took_s:>7.0f} {took_s / least:>5.2f}"
        print(f"{name:<14} {punch.from_rpm:>8.0f} {punch.to_rpm:>7.0f} {figures}", end=" ")
        print(f"{1e3 * (six_step.took_s or math.inf):>11.0f}" if six_step else f"{'-':>11}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
