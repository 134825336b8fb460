//! What the ESC tells of itself, in SI.

use crate::drive::{Faults, Phase, Snapshot};
use crate::units::Scale;

/// The state of the ESC as telemetry reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// Mechanical speed, rpm, signed.
    pub rpm: f32,
    /// Supply voltage, V.
    pub bus_v: f32,
    /// Current drawn from the supply, A, negative while braking.
    pub bus_a: f32,
    /// Charge drawn since the start, mAh.
    pub consumed_mah: f32,
    /// Temperature of the board, °C.
    pub temperature_c: f32,
    /// What the drive is doing.
    pub phase: Phase,
    /// Faults that hold the bridge off.
    pub faults: Faults,
    /// How often a fault has turned the bridge off since the start.
    pub fault_count: u32,
    /// Whether the throttle may turn the motor.
    pub armed: bool,
    /// Frames on the throttle wire that failed their check.
    pub bad_frames: u32,
}

/// Time over which the current is smoothed, µs: what flows in a period differs from the next by
/// the current's ripple, and a fifth of a second is what a person can read.
const READABLE_US: f32 = 200_000.0;

/// A charge in µA·µs. Whole numbers: a sum of floats would stop growing after some ampere-hours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Charge(i64);

impl Charge {
    /// Adds a current that has flowed for a while.
    pub fn add(&mut self, current_a: f32, time_us: u64) {
        let charge = (current_a * 1e6) as i64 * time_us as i64;
        self.0 = self.0.saturating_add(charge);
    }

    /// The charge in mAh.
    pub fn mah(self) -> f32 {
        // 3600 s of 1 mA.
        (self.0 / 1_000_000) as f32 / 3_600_000.0
    }
}

impl Telemetry {
    /// At power-up, before the first snapshot.
    pub const fn new() -> Self {
        Self {
            rpm: 0.0,
            bus_v: 0.0,
            bus_a: 0.0,
            consumed_mah: 0.0,
            temperature_c: 0.0,
            phase: Phase::Idle,
            faults: Faults::NONE,
            fault_count: 0,
            armed: false,
            bad_frames: 0,
        }
    }

    /// Takes in what the drive says after a further `time_us`.
    pub fn observe(&mut self, snapshot: &Snapshot, scale: &Scale, time_us: u64) {
        self.rpm = scale.rpm(snapshot.speed);
        self.bus_v = scale.volts(snapshot.bus);
        let bus_a = scale.amperes(snapshot.bus_current);
        self.bus_a += (bus_a - self.bus_a) * (time_us as f32 / READABLE_US).min(1.0);
        self.phase = snapshot.phase;
        self.faults = snapshot.faults;
        self.fault_count = snapshot.fault_count;
    }
}

impl Default for Telemetry {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_day_of_short_times_is_not_lost() {
        let mut charge = Charge::default();
        for _ in 0..24 * 36_000 {
            charge.add(5.0, 100_000);
        }
        assert!((charge.mah() - 120_000.0).abs() < 1.0, "{}", charge.mah());
        charge.add(-5.0, 3_600_000_000);
        assert!((charge.mah() - 115_000.0).abs() < 1.0, "{}", charge.mah());
    }
}
