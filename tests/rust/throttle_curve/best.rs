//! The best that is possible: the least power that turns a propeller, and its highest speed.

use std::f64::consts::FRAC_2_PI;

use siskin_emulator::plant::{Load, Motor, Supply};
use siskin_emulator::scenario::Standing;
use siskin_params::ParamId;

use super::Row;

/// Steps of i_d from none to the most.
const STEPS: u32 = 1000;

/// The bench in its steady state, with sinusoidal currents.
pub(crate) struct Bench {
    motor: Motor,
    load: Load,
    friction_nm: f64,
    supply: Supply,
    /// Its voltage without load.
    open_v: f64,
    phase_a: f64,
    bus_a: f64,
    /// The speed whose back-EMF, rectified by a bridge that is off, is `LIM_BUS_V_MAX`.
    fastest_rad_s: f64,
}

impl Bench {
    /// Takes a bench, and the supply from a run on it.
    pub(crate) fn new(standing: &Standing, row: &Row) -> Self {
        let bench = &standing.bench;
        let param = |id: ParamId| {
            let own = standing.params.iter().rfind(|(own, _)| *own == id);
            f64::from(own.map_or(id.entry().default, |(_, value)| *value))
        };
        let motor = bench.motor;
        let flux_per_turn = 3_f64.sqrt() * motor.flux_wb * f64::from(motor.pole_pairs);
        Self {
            motor,
            load: bench.load,
            friction_nm: bench.extras.drag.friction_nm,
            supply: bench.supply,
            open_v: row.bus_v + bench.supply.resistance_ohm * row.bus_a,
            phase_a: param(ParamId::LimPhaseA),
            bus_a: param(ParamId::LimBusA),
            fastest_rad_s: param(ParamId::LimBusVMax) / flux_per_turn,
        }
    }

    /// Returns the propeller's power.
    pub(crate) fn propeller_w(&self, rad_s: f64) -> f64 {
        self.load.damping_at(rad_s) * rad_s * rad_s
    }

    /// Returns the least power from the supply that turns the propeller at this speed, if any does: that with the least
    /// i_d whose voltage a six-step's fundamental reaches, 2/π of the supply.
    pub(crate) fn least_w(&self, rad_s: f64) -> Option<f64> {
        let Motor {
            resistance_ohm,
            inductance_h,
            flux_wb,
            pole_pairs,
            ..
        } = self.motor;
        let pole_pairs = f64::from(pole_pairs);
        let electrical = pole_pairs * rad_s;
        let torque_nm = self.friction_nm + self.load.damping_at(rad_s) * rad_s;
        let i_q = torque_nm / (1.5 * pole_pairs * flux_wb);
        if i_q > self.phase_a || rad_s > self.fastest_rad_s {
            return None;
        }
        let most = (self.phase_a * self.phase_a - i_q * i_q).sqrt();
        (0..=STEPS).find_map(|step| {
            let i_d = -most * f64::from(step) / f64::from(STEPS);
            let u_d = resistance_ohm * i_d - electrical * inductance_h * i_q;
            let u_q = resistance_ohm * i_q + electrical * (inductance_h * i_d + flux_wb);
            let power_w = 1.5 * (u_d * i_d + u_q * i_q);
            // NaN if the supply cannot give that much: then no comparison holds.
            let root =
                (self.open_v * self.open_v / 4.0 - self.supply.resistance_ohm * power_w).sqrt();
            let bus_v = self.open_v / 2.0 + root;
            let gives = u_d.hypot(u_q) <= FRAC_2_PI * bus_v && power_w <= self.bus_a * bus_v;
            gives.then_some(power_w)
        })
    }

    /// Returns the highest speed that is possible.
    pub(crate) fn best_rad_s(&self) -> f64 {
        let (mut low, mut high) = (0.0, self.fastest_rad_s);
        while high - low > 0.01 {
            let middle = (low + high) / 2.0;
            if self.least_w(middle).is_some() {
                low = middle;
            } else {
                high = middle;
            }
        }
        low
    }
}
