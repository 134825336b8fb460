"""Betaflight flies the quadrotor: step by step, on one clock."""

import hashlib
import struct

from betaflight import Betaflight
from body import Body
from plan import Plan
from quadrotor import Quadrotor, value_of

STEP_NS = 1_000_000


def sensors(body: Body) -> list[float]:
    """Returns the body as Betaflight's simulator takes it, in its axes and with its signs."""
    p, q, r = body.rates
    w, x, y, z = body.attitude
    north, west, up = body.speed
    height = body.place[2]
    felt = [-f for f in body.felt]
    return [p, -q, -r, *felt, w, x, -y, -z, -west, north, up, 0.0, 0.0, height, 101_325.0 - 12.0 * height]


def fly(folder, escs, plan: Plan) -> list[dict]:
    """Flies a plan once; returns what there was after each step. Betaflight runs in a folder that has its settings."""
    quadrotor, betaflight = Quadrotor(escs), Betaflight(folder)
    body = quadrotor.body
    rows, sticks = [], []
    try:
        for step in range(round(plan.END_S * 1e9) // STEP_NS):
            now_ns = step * STEP_NS
            now_s = now_ns * 1e-9
            if now_ns % plan.EVERY_NS == 0:
                sticks = plan.sticks(now_s, body.place[2], body.speed[2])
            written_ns, outputs = betaflight.advance(now_ns + STEP_NS, sensors(body), sticks)
            values = [value_of(us) for us in outputs]
            # It begins to write once it has calibrated its gyro.
            writes = now_ns <= written_ns < now_ns + STEP_NS
            frames = [
                (esc, written_ns - now_ns, value)
                for esc, value in enumerate(values)
                if writes and not plan.silent(now_s, esc)
            ]
            quadrotor.advance(STEP_NS, frames, plan.wind(now_s), plan.struck(now_s), plan.pack(now_s))
            rows.append({"s": now_s + STEP_NS * 1e-9, "values": values, **seen(quadrotor)})
    finally:
        betaflight.close()
    return rows


def seen(quadrotor: Quadrotor) -> dict:
    """Returns what a flight is judged by."""
    body, escs = quadrotor.body, quadrotor.escs.all
    roll, pitch = body.roll_pitch_deg
    return {
        "height": body.place[2],
        "roll": roll,
        "pitch": pitch,
        "tilt": body.tilt_deg,
        "attitude": body.attitude,
        "place": body.place,
        "rates": body.rates,
        "rpm": [esc.rpm for esc in escs],
        "reported": [esc.reported_rpm for esc in escs],
        "supply_v": escs[0].supply_v,
        "supply_a": sum(esc.supply_a for esc in escs),
    }


def hash_of(rows: list[dict], summary: list[dict]) -> str:
    """Returns a hash of all that was seen, and of each ESC's control state in each period, bit for bit."""
    digest = hashlib.sha256("".join(esc["trace_hash"] for esc in summary).encode())
    for row in rows:
        for value in row.values():
            numbers = value if isinstance(value, (list, tuple)) else [value]
            digest.update(struct.pack(f"<{len(numbers)}d", *numbers))
    return digest.hexdigest()[:16]
