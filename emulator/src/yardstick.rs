//! A fixed program against which the emulator's speed is stated: a machine's name and clock say
//! little, the ratio to this does.
//!
//! It is what a competent engineer writes straight from the textbook, neither slowed down nor
//! tuned: the motor in double precision, its circuit by the exact matrix exponential over each
//! period, and a sensorless field-oriented drive in single precision. Sine and cosine are computed
//! together, and constants once. Both run on the default bench (24 V, 15 kHz, Antigravity 4006
//! KV380 with its propeller) at 4500 rpm. There is no noise, no dead time and no converter. It must
//! not change: a change, even of the `libm` crate, makes earlier ratios worthless.

mod control;
mod plant;
mod setting;

use control::Control;
use plant::Plant;
use setting::BUS_V;

pub use setting::{PERIOD_S, RPM};

/// The drive and its motor.
#[derive(Clone, Debug)]
pub struct Yardstick {
    control: Control,
    plant: Plant,
    /// What the inverter does until the latest command takes effect.
    applied: [f32; 3],
}

impl Yardstick {
    /// Starts with the motor turning at [`RPM`] without current, and the drive knowing its angle.
    pub fn new() -> Self {
        Self {
            control: Control::new(),
            plant: Plant::new(),
            applied: [0.5; 3],
        }
    }

    /// Runs the next period: currents, control, and the motor under the previous period's duties.
    pub fn period(&mut self) {
        let currents_a = self.plant.currents_a().map(|current_a| current_a as f32);
        let duties = self.control.step(currents_a, BUS_V as f32);
        let applied = std::mem::replace(&mut self.applied, duties);
        self.plant.period(applied.map(f64::from));
    }

    /// Returns the mechanical speed, rpm.
    pub fn rpm(&self) -> f64 {
        self.plant.rpm()
    }

    /// Returns the estimated less true electrical angle, degrees, ±180.
    pub fn angle_error_deg(&self) -> f64 {
        let error = self.control.angle_rad() - self.plant.angle_rad();
        let turns = error / std::f64::consts::TAU;
        (turns - turns.round()) * 360.0
    }
}

impl Default for Yardstick {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// It does the work that it stands for.
    #[test]
    fn it_holds_its_speed_by_its_own_estimate() {
        let mut yardstick = Yardstick::new();
        for _ in 0..15_000 {
            yardstick.period();
        }
        for _ in 0..1_500 {
            yardstick.period();
            assert!((yardstick.rpm() - RPM).abs() < 1.0, "{}", yardstick.rpm());
            let error_deg = yardstick.angle_error_deg();
            assert!(error_deg.abs() < 2.0, "{error_deg}");
        }
    }
}
