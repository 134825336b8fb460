//! The ESC's state in SI.

use crate::drive::{Faults, Limits, Phase, Snapshot};
use crate::input::authority::{Command, DriveStatus};
use crate::input::signal::Signal;
use crate::math::{SQRT_3, square_root};
use crate::statistics::Statistics;
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
    /// The drive's phase.
    pub phase: Phase,
    /// Faults that hold the bridge off.
    pub faults: Faults,
    /// Limits that bind.
    pub limits: Limits,
    /// Number of times that a fault has turned the bridge off since the start.
    pub fault_count: u32,
    /// Starts in a row that have failed: the motor is tried again, a few times.
    pub failed_starts: u8,
    /// True if the throttle may turn the motor.
    pub armed: bool,
    /// Frames on the throttle wire that failed their check, since the start.
    pub bad_frames: u32,
    /// Their share in the last second, 0 to 1.
    pub bad_share: f32,
    /// The signal on the throttle wire; none before it has been identified, and on a silent wire.
    pub signal: Option<Signal>,
    /// Signals of the control that can be streamed, in the order of [`SIGNALS`].
    pub signals: [f32; SIGNALS.len()],
    /// Statistics over its life.
    pub statistics: Statistics,
}

/// Names of the control's signals that can be streamed, in the order of the bits of `TEL_SIGNALS`:
/// mechanical speed and its reference, rpm; current and voltage in the rotor's frame, A and V;
/// voltage as a share of what the supply gives without over-modulation; the supply's voltage and
/// current as they are now, V and A.
pub const SIGNALS: [&str; 9] = [
    "rpm", "rpm_ref", "i_d", "i_q", "v_d", "v_q", "duty", "bus_v", "bus_a",
];

/// Below this the shaft counts as at rest when the bridge does not drive it, rpm. It is the lowest
/// speed that can be asked for (`CTL_RPM_MIN` goes down to it), and above the noise of an estimate
/// at standstill.
const AT_REST_RPM: f32 = 100.0;

/// Time over which the current is smoothed, µs: what flows in a period differs from the next by
/// the current's ripple, and a fifth of a second is what a person can read.
const READABLE_US: u32 = 200_000;

/// A charge in µA·µs. Whole numbers: a sum of floats would stop growing after some ampere-hours.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Charge(i64);

impl Charge {
    /// Adds a current that has flowed for a while.
    pub fn add(&mut self, current_a: f32, time_us: u64) {
        let charge = i64::from((current_a * 1e6) as i32) * time_us as i64;
        self.0 = self.0.saturating_add(charge);
    }

    /// The charge in mAh.
    pub fn mah(self) -> f32 {
        // 3600 s of 1 mA. The upper word counts 0.0012 mAh, and a word is a float in one instruction.
        let upper = (self.0 >> 32) as i32;
        upper as f32 * (4_294_967_296.0 / 3.6e12)
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
            limits: Limits::NONE,
            fault_count: 0,
            failed_starts: 0,
            armed: false,
            bad_frames: 0,
            bad_share: 0.0,
            signal: None,
            signals: [0.0; SIGNALS.len()],
            statistics: Statistics::NONE,
        }
    }

    /// The state that decides on tests: at rest, and sound, with the present command. A start begins
    /// with phases that do not turn the motor yet.
    pub fn drive(&self, command: Command) -> DriveStatus {
        let at_rest = !self.phase.drives() && self.rpm.abs() < AT_REST_RPM;
        DriveStatus {
            stopped: at_rest && command.rests(),
            faulted: !self.faults.is_empty(),
        }
    }

    /// Takes in the drive's snapshot after a further `time_us`.
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
        // A root is of a number above 0, and without a supply there is no share of it.
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
    use super::*;
    use crate::drive::State;
    use crate::math::Real;
    use crate::params::{BOSSO_BENCH, Board, Params, build};
    use crate::units::Voltage;

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
        telemetry.observe(&snapshot, &scale, 1000);
        // 5 of 24/√3 V.
        let duty = 5.0 * SQRT_3 / 24.0;
        let wanted = [-3000.0, -3100.0, -0.5, -4.0, 3.0, -4.0, duty, 24.0, -1.25];
        for ((name, found), wanted) in SIGNALS.iter().zip(telemetry.signals).zip(wanted) {
            assert!((found - wanted).abs() < 1e-3, "{name}: {found}");
        }
        // Values for a person are smoothed.
        assert!(telemetry.bus_a > -0.1);
        snapshot.bus = Voltage::ZERO;
        telemetry.observe(&snapshot, &scale, 1000);
        assert!(telemetry.signals.iter().all(|signal| signal.is_finite()));
    }
}
