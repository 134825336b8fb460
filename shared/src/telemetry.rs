//! The ESC's state in SI units.

use siskin_throttle::authority::{Command, DriveStatus};
use siskin_throttle::signal::Signal;
use siskin_units::Scale;
use siskin_units::math::{SQRT_3, square_root};

use crate::drive::{Faults, Limits, Phase, Snapshot};
use crate::statistics::Statistics;

/// The ESC's state as telemetry reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Telemetry {
    /// Mechanical speed, rpm, signed.
    pub rpm: f32,
    /// Supply voltage, V.
    pub bus_v: f32,
    /// Supply current, A, negative while braking.
    pub bus_a: f32,
    /// Charge drawn since power-up, mAh.
    pub consumed_mah: f32,
    /// Board temperature, °C.
    pub temperature_c: f32,
    /// Phase of the drive.
    pub phase: Phase,
    /// Faults that hold the bridge off.
    pub faults: Faults,
    /// Limits that bind.
    pub limits: Limits,
    /// Number of times a fault has turned the bridge off since power-up.
    pub fault_count: u32,
    /// Consecutive failed starts; the drive retries a few times. A row of quick attempts counts as one.
    pub failed_starts: u8,
    /// The motor's resistance as it is followed, mΩ; 0 where this program follows none.
    pub r_mohm: f32,
    /// Its flux, mWb, likewise.
    pub flux_mwb: f32,
    /// Throttle may turn the motor.
    pub armed: bool,
    /// Frames on the throttle wire that failed their check since power-up.
    pub bad_frames: u32,
    /// Share of bad frames in the last second, 0 to 1.
    pub bad_share: f32,
    /// Signal on the throttle wire; `None` before identification and on a silent wire.
    pub signal: Option<Signal>,
    /// Control signals for streaming, in the order of [`SIGNALS`].
    pub signals: [f32; SIGNALS.len()],
    /// Lifetime statistics.
    pub statistics: Statistics,
}

/// Names of the streamable control signals, in the bit order of `TEL_SIGNALS`: mechanical speed and its
/// reference, rpm; current and voltage in the rotor's frame, A and V; voltage as a share of the maximum without
/// over-modulation; instantaneous supply voltage and current, V and A; the motor's followed resistance and flux, mΩ and
/// mWb.
pub const SIGNALS: [&str; 11] = [
    "rpm", "rpm_ref", "i_d", "i_q", "v_d", "v_q", "duty", "bus_v", "bus_a", "r_mohm", "flux_mwb",
];

/// Below this speed the shaft counts as at rest when the bridge does not drive it, rpm. It is the lowest
/// `CTL_RPM_MIN`, and above the noise of an estimate at standstill.
const AT_REST_RPM: f32 = 100.0;

/// Smoothing time of the current, µs: ripple makes it differ from period to period, and a person can read a
/// value every fifth of a second.
const READABLE_US: u32 = 200_000;

/// Charge in µA·µs. An integer, since a float sum would stop growing after a few ampere-hours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Charge(i64);

impl Charge {
    /// Adds a current that flowed for `time_us`.
    pub fn add(&mut self, current_a: f32, time_us: u64) {
        let charge = i64::from((current_a * 1e6) as i32) * time_us as i64;
        self.0 = self.0.saturating_add(charge);
    }

    /// Returns the charge in mAh.
    pub fn mah(self) -> f32 {
        // 1 mA for 3600 s. One count of the upper word is 0.0012 mAh, and a word converts to float in one
        // instruction.
        let upper = (self.0 >> 32) as i32;
        upper as f32 * (4_294_967_296.0 / 3.6e12)
    }
}

impl Telemetry {
    /// Creates the state at power-up, before the first snapshot.
    pub const fn new() -> Self {
        Self {
            rpm: 0.0,
            bus_v: 0.0,
            bus_a: 0.0,
            consumed_mah: 0.0,
            temperature_c: 0.0,
            phase: Phase::Idle,
            faults: Faults::NONE,
            limits: Limits::NONE,
            fault_count: 0,
            failed_starts: 0,
            r_mohm: 0.0,
            flux_mwb: 0.0,
            armed: false,
            bad_frames: 0,
            bad_share: 0.0,
            signal: None,
            signals: [0.0; SIGNALS.len()],
            statistics: Statistics::NONE,
        }
    }

    /// Returns the state that decides whether a test may run: at rest and without a fault. The command
    /// counts too, since a start begins with phases that do not turn the motor yet.
    pub fn drive(&self, command: Command) -> DriveStatus {
        let at_rest = !self.phase.drives() && self.rpm.abs() < AT_REST_RPM;
        DriveStatus {
            stopped: at_rest && command.rests(),
            faulted: !self.faults.is_empty(),
        }
    }

    /// Returns true if the drive knows the rotor and turns it, either way: at half of the least `CTL_RPM_MIN` or faster.
    pub fn turns(&self) -> bool {
        self.phase == Phase::Run && 2.0 * self.rpm.abs() >= AT_REST_RPM
    }

    /// Takes in the drive's snapshot, `time_us` after the previous one.
    pub fn observe(&mut self, snapshot: &Snapshot, scale: &Scale, time_us: u64) {
        self.rpm = scale.rpm(snapshot.speed);
        self.bus_v = scale.volts(snapshot.bus);
        let bus_a = scale.amperes(snapshot.bus_current);
        let time_us = time_us.min(READABLE_US.into()) as u32;
        self.bus_a += (bus_a - self.bus_a) * (time_us as f32 / READABLE_US as f32);
        self.phase = snapshot.phase;
        self.faults = snapshot.faults;
        self.fault_count = snapshot.fault_count;
        self.failed_starts = snapshot.failed_starts;
        let (v_d, v_q) = (scale.volts(snapshot.u.d), scale.volts(snapshot.u.q));
        let square = v_d * v_d + v_q * v_q;
        // The root needs a positive argument, and without a supply the share is undefined.
        let duty = if self.bus_v > 0.0 && square > 0.0 {
            SQRT_3 * square_root(square) / self.bus_v
        } else {
            0.0
        };
        self.signals = [
            self.rpm,
            scale.rpm(snapshot.speed_reference),
            scale.amperes(snapshot.i.d),
            scale.amperes(snapshot.i.q),
            v_d,
            v_q,
            duty,
            self.bus_v,
            bus_a,
            self.r_mohm,
            self.flux_mwb,
        ];
    }
}

impl Default for Telemetry {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use siskin_params::{BOSSO_BENCH, Board, Params};
    use siskin_units::Voltage;
    use siskin_units::math::Real;

    use super::*;
    use crate::build::build;
    use crate::drive::State;

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

    #[test]
    fn signals_are_what_the_snapshot_says_in_si() {
        let config = build(&Params::of(&BOSSO_BENCH), &Board::BENCH).expect("the defaults fit");
        let scale = config.scale;
        let mut snapshot = State::new(&config).snapshot();
        let volts = |v: f32| Voltage::from_f32(v / scale.voltage_v);
        snapshot.speed = scale.speed_from_rpm(-3000.0);
        snapshot.speed_reference = scale.speed_from_rpm(-3100.0);
        snapshot.i.d = scale.current_from_a(-0.5);
        snapshot.i.q = scale.current_from_a(-4.0);
        snapshot.u.d = volts(3.0);
        snapshot.u.q = volts(-4.0);
        snapshot.bus = volts(24.0);
        snapshot.bus_current = scale.current_from_a(-1.25);
        let mut telemetry = Telemetry::new();
        telemetry.r_mohm = 54.0;
        telemetry.flux_mwb = 1.2;
        telemetry.observe(&snapshot, &scale, 1000);
        // 5 of 24/√3 V.
        let duty = 5.0 * SQRT_3 / 24.0;
        let wanted = [
            -3000.0, -3100.0, -0.5, -4.0, 3.0, -4.0, duty, 24.0, -1.25, 54.0, 1.2,
        ];
        for ((name, found), wanted) in SIGNALS.iter().zip(telemetry.signals).zip(wanted) {
            assert!((found - wanted).abs() < 1e-3, "{name}: {found}");
        }
        // Displayed values are smoothed.
        assert!(telemetry.bus_a > -0.1);
        snapshot.bus = Voltage::ZERO;
        telemetry.observe(&snapshot, &scale, 1000);
        assert!(telemetry.signals.iter().all(|signal| signal.is_finite()));
    }
}
