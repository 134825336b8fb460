"""Motors that the ESC identifies by the one command, and how it then drives them, with no parameter touched.

    target/venv/bin/python tests/python/identified.py --motors 500 --steps 150 --jobs 2

identifies each, flies it with the results, through slams of the throttle and to full speed, and prints a row for each.
It exits with status 1 if fewer than 95 % are found within bounds, if one is refused without a reason, if one is
accepted that is wrong by more than double or takes 20 s or more of motor time, or if fewer than 99 % of those accepted
start, reach full speed and hold through the slams.
"""

import random
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path

import campaign
import paths

sys.path.insert(0, str(paths.DIALECT))

import siskin  # noqa: E402
import siskin_dialect as dialect  # noqa: E402  (it needs the dialect's folder)
from motors import any_motor, drawn_bench, flown, toml  # noqa: E402
from out_of_the_bag import FACTORY, limits  # noqa: E402
from slams import Outcome as Slams  # noqa: E402
from slams import PLANTS, throttles, slams_of  # noqa: E402

BOUNDS = {"MOT_R_MOHM": 0.03, "MOT_L_UH": 0.05, "MOT_FLUX_MWB": 0.02, "MOT_J_GCM2": 0.1}
WRONG = 2.0
LONGEST_S = 20.0
FULL_SPEED = 0.95
BEGIN, KEEP = 1, 2
LOOK_S = 0.01
TEXTS_WITHIN_S = 0.2
KEEPS_WITHIN_S = 60.0
"""By when the shaft stands."""


@dataclass(frozen=True)
class Found:
    """How an identification has ended."""

    ratios: dict
    """What was found over the truth; empty if refused."""
    texts: list
    """What it was refused with."""
    took_s: float

    def is_near(self) -> bool:
        return bool(self.ratios) and all(abs(self.ratios[name] - 1) < bound for name, bound in BOUNDS.items())

    def is_wrong(self) -> bool:
        return any(not 1 / WRONG < ratio < WRONG for ratio in self.ratios.values())

    def is_sound(self) -> bool:
        """Returns whether it was refused with a reason, or found without gross error, in time."""
        return bool(self.ratios or self.texts) and not self.is_wrong() and self.took_s < LONGEST_S


@dataclass(frozen=True)
class Outcome:
    """What became of a motor."""

    found: Found
    full_speed: float
    """Speed at full throttle over CTL_RPM_MAX."""
    slams: Slams | None

    def flies(self) -> bool:
        return self.slams is not None and self.slams.holds() and self.full_speed > FULL_SPEED


class Station:
    """A ground station in simulated time."""

    def __init__(self, emulator: siskin.Emulator):
        self.emulator = emulator
        self.codec = dialect.MAVLink(emulator.mavlink, srcSystem=255, srcComponent=190)

    def command(self, param: int) -> tuple[int, list, float]:
        """Sends MAV_CMD_USER_1; returns its final result, the refusals in its texts, and how long it took, s."""
        begun_s = self.emulator.time_s
        self.codec.command_long_send(1, 1, dialect.MAV_CMD_USER_1, 0, param, *[0] * 6)
        messages, ends = [], []
        while not ends:
            messages += self.look(LOOK_S)
            acks = [message for message in messages if message.get_type() == "COMMAND_ACK"]
            ends = [ack.result for ack in acks if ack.result != dialect.MAV_RESULT_IN_PROGRESS]
        took_s = self.emulator.time_s - begun_s
        messages += self.look(TEXTS_WITHIN_S)
        texts = [message.text for message in messages if message.get_type() == "STATUSTEXT"]
        return ends[0], [text for text in texts if text.startswith("Not ")], took_s

    def look(self, seconds: float) -> list:
        """Returns the messages sent in this time."""
        self.emulator.advance(seconds)
        return self.codec.parse_buffer(self.emulator.mavlink.read()) or []


def salient_bench(motor: dict) -> dict[str, dict]:
    """Returns a scenario's tables with a drawn motor, whose L_d and L_q may differ."""
    tables = drawn_bench(motor)
    mean = tables["bench.motor"].pop("L")
    share = motor["saliency"]
    tables["bench.motor"] |= {"L_d": mean * (1 - share), "L_q": mean * (1 + share)}
    return tables


def identified(folder: Path, motor: dict, params: dict) -> tuple[Found, dict]:
    """Returns what the ESC finds about a motor, and the parameters that it keeps."""
    tables = salient_bench(motor)
    file = folder / "bench.toml"
    file.write_text("\n".join(f"[{name}]\n{toml(table)}" for name, table in tables.items()))
    emulator = siskin.Emulator(file, escs=1, params=params)
    station = Station(emulator)
    emulator.throttle[:] = 0.0
    emulator.advance(0.5)
    result, texts, took_s = station.command(BEGIN)
    if result != dialect.MAV_RESULT_ACCEPTED:
        return Found({}, texts, took_s), {}
    result = dialect.MAV_RESULT_TEMPORARILY_REJECTED
    while result == dialect.MAV_RESULT_TEMPORARILY_REJECTED and emulator.time_s < KEEPS_WITHIN_S:
        emulator.advance(0.5)
        result, texts, _ = station.command(KEEP)
    if result != dialect.MAV_RESULT_ACCEPTED:
        return Found({}, texts, took_s), {}
    kept = {name: emulator.params[name] for name in BOUNDS}
    return Found({name: value / motor["params"][name] for name, value in kept.items()}, [], took_s), kept


def flies(folder: Path, number: int, steps: int) -> Outcome:
    """Identifies the motor of this number, then slams it and brings it to full speed; odd numbers do so on the
    switching plant."""
    motor = any_motor(random.Random(f"bag {number}"))
    # Up to what outrunners on the market have.
    motor["saliency"] = random.Random(f"saliency {number}").choice([0.0, 0.15])
    # The builder sets the limits, the pole pairs and the speed at full throttle, all before it turns.
    known = {name: motor["params"][name] for name in ("MOT_POLE_PAIRS", "CTL_RPM_MAX")}
    params = FACTORY | limits(motor) | known
    found, kept = identified(folder, motor, params)
    if not kept:
        return Outcome(found, 0.0, None)
    throttle, end_s = throttles(random.Random(f"slams {number}"), steps)
    full_s = end_s + 2.0
    tables = salient_bench(motor) | {"params": params | kept}
    tables["bench"] |= {"duration_s": full_s, "plant": PLANTS[number % 2]}
    windows = {"all": (1.4, end_s), "idle": (end_s - 0.2, end_s), "full": (full_s - 0.2, full_s)}
    told, windows = flown(folder, tables, [*throttle, (end_s, 1.0)], windows)
    return Outcome(found, windows["full"]["rpm_min"] / motor["rpm"], slams_of(told, windows))


def main() -> int:
    given = campaign.words(__doc__, motors=500, steps=(150, "steps of the throttle"))
    outcomes = []
    heads = " ".join(f"{name[4:]:>9}" for name in BOUNDS)
    print(f"{'motor':>5} {heads} {'took':>5} {'full':>5} {'starts':>6} {'worst':>6} {'idle':>5}  texts, or faults and warnings")
    for number, outcome in campaign.played(
        campaign.numbers(given), lambda folder, number: flies(folder, number, given.steps), given.jobs
    ):
        outcomes.append(outcome)
        found, slams = outcome.found, outcome.slams
        errors = " ".join(f"{100 * (found.ratios[name] - 1):>8.1f}%" if found.ratios else f"{'-':>9}" for name in BOUNDS)
        flown_so = f"{'-':>5} {'-':>6} {'-':>6} {'-':>5}"
        if slams:
            angles = f"{slams.worst_deg:>6.1f} {slams.idle_deg:>5.1f}"
            flown_so = f"{outcome.full_speed:>5.2f} {slams.starts:>6} {angles}"
        told = ", ".join([*found.texts, *(slams.told if slams else [])])
        print(f"{number:>5} {errors} {found.took_s:>5.1f} {flown_so}  {told}".rstrip(), flush=True)
    found = [outcome.found for outcome in outcomes]
    near = sum(one.is_near() for one in found)
    sound = sum(one.is_sound() for one in found)
    accepted = [outcome for outcome in outcomes if outcome.slams]
    fly = sum(outcome.flies() for outcome in accepted)
    times_s = [one.took_s for one in found]
    print(f"{near} of {len(found)} within bounds, {len(accepted)} accepted, {sound} sound", end="; ")
    print(f"time, median and most: {statistics.median(times_s):.1f} and {max(times_s):.1f} s", end="; ")
    print(f"{fly} of {len(accepted)} fly")
    good = near >= 0.95 * len(found) and sound == len(found) and fly >= 0.99 * len(accepted)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
