//! Averages what the drive shows over many looks.

use core::f32::consts::TAU;

use crate::drive::Snapshot;
use crate::math::Real;
use crate::units::Scale;

/// Looks averaged for an excitation.
pub(super) const EXCITED_LOOKS: u16 = 150;

/// Looks averaged for a turning rotor.
pub(super) const SPUN_LOOKS: u16 = 200;

/// Returns the time elapsed, s: less than an hour, so the low words suffice.
pub(super) fn seconds(now_us: u64, then_us: u64) -> f32 {
    1e-6 * (now_us as u32).wrapping_sub(then_us as u32) as f32
}

/// What the drive shows, or its mean: currents along d and q, A, voltages along d and q, V, and the electrical speed,
/// rad/s. During an excitation those along q are amplitudes of the square wave.
pub(super) type Seen = [f32; 5];

// Out of line: two steps call it.
#[inline(never)]
pub(super) fn seen(snapshot: &Snapshot, scale: &Scale) -> Seen {
    let (i, u) = (snapshot.i, snapshot.u);
    [
        scale.amperes(i.d),
        scale.amperes(i.q),
        scale.volts(u.d),
        scale.volts(u.q),
        snapshot.speed.to_f32() * TAU / scale.period_s,
    ]
}

/// Sums over the looks of a step.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Means {
    pub(super) looks: u16,
    sums: Seen,
}

impl Means {
    // Out of line, like `seen`.
    #[inline(never)]
    pub(super) fn add(&mut self, snapshot: &Snapshot, scale: &Scale) {
        self.looks += 1;
        for (sum, value) in self.sums.iter_mut().zip(seen(snapshot, scale)) {
            *sum += value;
        }
    }

    pub(super) fn get(&self) -> Seen {
        self.sums.map(|sum| sum / f32::from(self.looks))
    }
}
