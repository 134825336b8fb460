"""Full throttle: how close a motor comes to the fastest that its supply, its limits and its propeller allow.

    target/venv/bin/python tests/python/full_throttle.py --motors 20 --jobs 2

plays each propeller bench of the library, as it is and stated wrongly, and this many random motors, in speed and in
voltage mode, on the switching plant, with slams between idle and full at the end; and each bench in six-step, with
nothing told about its motor, at 60 kHz. It prints a row for each, and exits with status 1 if one does not hold.
"""

import math
import random
import sys
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import campaign
import paths

sys.path.insert(0, str(paths.DIALECT))

# They need the dialect's folder.
from emulator import MOTOR  # noqa: E402
from motors import FROM_MOTOR, drawn_bench, flown, motor_of, tune  # noqa: E402
from slams import IDLE, MODES  # noqa: E402
from thrust import PROPELLERS, bench  # noqa: E402

SIX_STEP_SHARE = 2 / math.pi
"""A six-step's fundamental over the supply: no other switching has more."""
CELL_V = 4.1
"""A cell of a pack that is charged to 0.9."""
LEAST = 0.97
"""Least share of the best speed."""
LEAST_WRONG = 0.94
"""The same of a motor that is stated wrong."""
LEAST_SIX_STEP = 0.93
"""The same in six-step."""
SIX_STEP_HZ = 60_000
SIX_STEP_PERIODS = 21
"""PWM periods in an electrical turn at the fastest speed that six-step follows."""
SIX_STEP_REACHES = ["quad-15-inch", "lift-28-inch", "ducted-fan"]
"""The benches that are to reach it. The others' inductance takes more of the voltage than an advance of 30 degrees gives,
or they would be too fast for the samples: then the speed is to be held where those end."""


@dataclass(frozen=True)
class Plant:
    """A motor with its propeller and limits, in SI."""

    r: float
    l: float
    flux: float
    pole_pairs: int
    phase_a: float
    bus_a: float
    fastest_rad_s: float
    load: dict
    friction_nm: float

    def torque_nm(self, rad_s: float) -> float:
        drag = self.load.get("c1", 0.0) * rad_s + self.load.get("c2", 0.0) * rad_s**2
        return self.friction_nm + drag

    def turns_at(self, rpm: float, supply_v: float, supply_ohm: float) -> bool:
        """Returns whether any i_d within the limits turns the propeller at this speed: the machine's steady equations."""
        rad_s = rpm * math.tau / 60
        electrical = rad_s * self.pole_pairs
        i_q = self.torque_nm(rad_s) / (1.5 * self.pole_pairs * self.flux)
        if i_q > self.phase_a or rad_s > self.fastest_rad_s:
            return False
        most = math.sqrt(self.phase_a**2 - i_q**2)
        for step in range(101):
            i_d = -most * step / 100
            u_d = self.r * i_d - electrical * self.l * i_q
            u_q = self.r * i_q + electrical * (self.l * i_d + self.flux)
            power_w = 1.5 * (u_d * i_d + u_q * i_q)
            # The supply's own resistance takes its part of the voltage.
            square = supply_v**2 / 4 - supply_ohm * power_w
            if square < 0:
                continue
            bus_v = supply_v / 2 + math.sqrt(square)
            if power_w / bus_v <= self.bus_a and math.hypot(u_d, u_q) <= SIX_STEP_SHARE * bus_v:
                return True
        return False

    def best_rpm(self, supply_v: float, supply_ohm: float) -> float:
        """Returns the highest speed that is possible."""
        low, high = 0.0, 200_000.0
        while high - low > 5.0:
            rpm = (low + high) / 2
            low, high = (rpm, high) if self.turns_at(rpm, supply_v, supply_ohm) else (low, rpm)
        return low


@dataclass(frozen=True)
class Outcome:
    share: float
    """Speed at full throttle over the best."""
    told: list
    """Faults and warnings."""
    lost: bool
    """An error of 90 degrees or more, from the first climb to the end of the slams."""
    current_share: float
    """Largest current from the first climb to the end of the slams, over LIM_PHASE_A."""

    def holds(self, least: float) -> bool:
        return self.share >= least and not self.told and not self.lost and self.current_share < 1.2


def plant_of(motor: dict, load: dict, params: dict, scale: dict) -> Plant:
    phase_a, bus_a = params.get("LIM_PHASE_A", 20.0), params.get("LIM_BUS_A", 30.0)
    true = {key: motor[key] * scale.get(key, 1.0) for key in ("R", "L", "flux")}
    # Beyond, the bridge off would rectify more than the supply's greatest voltage.
    fastest = params.get("LIM_BUS_V_MAX", 30.0) / math.sqrt(3) / motor["flux"] / motor["pole_pairs"]
    friction_nm = motor.get("friction_nm", 0.0)
    return Plant(*true.values(), motor["pole_pairs"], phase_a, bus_a, fastest, load, friction_nm)


def opened(folder: Path, tables: dict, plant: Plant, supply: tuple[float, float], mode: str) -> Outcome:
    """Opens the throttle fully, and slams it between idle and full; the supply is its voltage and its resistance."""
    supply_v, supply_ohm = supply
    throttle = [(0.0, 0.0), (0.5, 0.2), (1.5, 1.0), (4.5, IDLE), (5.0, 1.0), (5.4, IDLE), (5.5, 1.0), (6.0, IDLE)]
    tables["bench"] |= {"plant": "switching", "duration_s": 6.5}
    # In speed mode the full throttle asks for more than there is.
    tables["params"] |= {"CTL_MODE": MODES[mode], "CTL_RPM_MAX": 1.07 * plant.best_rpm(supply_v, supply_ohm)}
    told, seen = flown(folder, tables, throttle, {"full": (4.2, 4.5), "all": (1.4, 6.5)})
    full = seen["full"]
    # The supply as it is then, but for its own resistance.
    supply_v = full["bus_v_mean"] + supply_ohm * full["bus_a_mean"]
    share = full["rpm_mean"] / plant.best_rpm(supply_v, supply_ohm)
    return Outcome(share, told, seen["all"]["lock_lost"], seen["all"]["current_max_a"] / plant.phase_a)


def supply_of(tables: dict) -> tuple[float, float]:
    """Returns the voltage and the resistance of a bench's supply."""
    bus = tables["bench"]["bus"]
    pack = isinstance(bus, dict)
    return (CELL_V * bus["cells"], bus["resistance_mohm"] * 1e-3) if pack else (bus, 0.0)


def of_library(folder: Path, name: str, mode: str, wrong: int) -> Outcome:
    """Opens a bench's throttle. With `wrong` above 0, the draw's number, R and L are stated wrong by up to 30 %, the flux
    by 10 %."""
    tables = bench(name)
    draw = random.Random(f"{name} {mode} {wrong}")
    scale = {key: draw.uniform(0.7, 1.3) for key in "RL"} | {"flux": draw.uniform(0.9, 1.1)} if wrong else {}
    plant = plant_of(tables["bench"]["motor"], tables["bench"]["load"], tables["params"], scale)
    supply = supply_of(tables)
    tables = {"bench": {"base": name}, "bench.scale": scale, "params": {}}
    return opened(folder, tables, plant, supply, mode)


def in_six_step(folder: Path, name: str) -> Outcome:
    """Opens a bench's throttle with nothing told about its motor. The best speed is no more than the samples follow."""
    tables = bench(name)
    plant = plant_of(tables["bench"]["motor"], tables["bench"]["load"], tables["params"], {})
    followed_rad_s = math.tau * SIX_STEP_HZ / SIX_STEP_PERIODS / plant.pole_pairs
    plant = replace(plant, fastest_rad_s=min(plant.fastest_rad_s, followed_rad_s))
    params = dict.fromkeys([*MOTOR, *FROM_MOTOR], 0) | {"CTL_DRIVE": 2, "PWM_FREQ_HZ": SIX_STEP_HZ}
    return opened(folder, {"bench": {"base": name}, "params": params}, plant, supply_of(tables), "voltage")


def drawn(folder: Path, number: int, mode: str) -> Outcome:
    """Opens the throttle of the random motor of this number."""
    motor = motor_of(random.Random(number))
    params = motor["params"]
    params |= {"PWM_FREQ_HZ": tune(params)["PWM_FREQ_HZ"], "LIM_BUS_A": min(200.0, 2 * params["LIM_PHASE_A"])}
    tables = drawn_bench(motor) | {"params": params | dict.fromkeys(FROM_MOTOR, 0)}
    plant = plant_of(tables["bench.motor"], tables["bench.load"], params, {})
    return opened(folder, tables, plant, (motor["supply_v"], 0.0), mode)


def main() -> int:
    given = campaign.words(__doc__, motors=20, wrong=(3, "how many wrong statements of each bench"))
    benches = [(name, mode, wrong) for name in PROPELLERS for mode in MODES for wrong in range(given.wrong + 1)]
    motors = list(product(campaign.numbers(given), MODES))
    failed = 0
    print(f"{'motor':<14} {'mode':<8} {'wrong':>5} {'share':>6} {'current':>7}  faults, warnings")
    # Each with the first columns of its row.
    cases = [(of_library, case, case, LEAST_WRONG if case[2] else LEAST) for case in benches]
    cases += [(drawn, case, (*case, 0), LEAST) for case in motors]
    cases += [(in_six_step, (name,), (name, "six-step", 0), LEAST_SIX_STEP) for name in PROPELLERS]
    for (_, _, (name, mode, wrong), least), outcome in campaign.played(
        cases, lambda folder, case: case[0](folder, *case[1]), given.jobs
    ):
        held = outcome.holds(least)
        failed += not held
        told = ", ".join(map(str, outcome.told + ["lost"] * outcome.lost))
        figures = f"{outcome.share:>6.3f} {outcome.current_share:>7.2f}"
        print(f"{name:<14} {mode:<8} {wrong:>5} {figures}  {'' if held else 'NO '}{told}".rstrip(), flush=True)
    print(f"{len(cases) - failed} of {len(cases)} hold")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
