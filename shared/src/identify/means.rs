//! Averages what the drive shows over many polls.

use core::f32::consts::TAU;

use siskin_units::Scale;
use siskin_units::math::Real;

use crate::drive::Snapshot;

/// Polls averaged for an excitation.
pub(super) const EXCITED_POLLS: u16 = 150;

/// Polls averaged for a turning rotor.
pub(super) const SPUN_POLLS: u16 = 200;

/// Returns the time elapsed, s: less than an hour, so the low words suffice.
pub(super) fn seconds(now_us: u64, then_us: u64) -> f32 {
    1e-6 * (now_us as u32).wrapping_sub(then_us as u32) as f32
}

/// Where the motor operates, at one moment or on average.
#[derive(Clone, Copy, Debug)]
pub(super) struct OperatingPoint {
    pub(super) i_d_a: f32,
    /// During an excitation the amplitude of the square wave's current.
    pub(super) i_q_a: f32,
    pub(super) u_d_v: f32,
    /// During an excitation the amplitude of the square wave's voltage.
    pub(super) u_q_v: f32,
    /// Electrical speed.
    pub(super) omega_rad_s: f32,
}

impl OperatingPoint {
    /// Converts a snapshot to SI units.
    // Out of line: two steps call it.
    #[inline(never)]
    pub(super) fn of(snapshot: &Snapshot, scale: &Scale) -> Self {
        let (i, u) = (snapshot.i, snapshot.u);
        Self {
            i_d_a: scale.amperes(i.d),
            i_q_a: scale.amperes(i.q),
            u_d_v: scale.volts(u.d),
            u_q_v: scale.volts(u.q),
            omega_rad_s: snapshot.speed.to_f32() * TAU / scale.period_s,
        }
    }

    fn from_values([i_d_a, i_q_a, u_d_v, u_q_v, omega_rad_s]: [f32; 5]) -> Self {
        Self {
            i_d_a,
            i_q_a,
            u_d_v,
            u_q_v,
            omega_rad_s,
        }
    }

    fn values(self) -> [f32; 5] {
        [
            self.i_d_a,
            self.i_q_a,
            self.u_d_v,
            self.u_q_v,
            self.omega_rad_s,
        ]
    }
}

/// Averages of an operating point over the polls of a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Means {
    pub(super) polls: u16,
    sums: [f32; 5],
}

impl Means {
    // Out of line, like `OperatingPoint::of`.
    #[inline(never)]
    pub(super) fn add(&mut self, snapshot: &Snapshot, scale: &Scale) {
        self.polls += 1;
        let values = OperatingPoint::of(snapshot, scale).values();
        for (sum, value) in self.sums.iter_mut().zip(values) {
            *sum += value;
        }
    }

    pub(super) fn get(&self) -> OperatingPoint {
        OperatingPoint::from_values(self.sums.map(|sum| sum / f32::from(self.polls)))
    }
}
