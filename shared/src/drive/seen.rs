//! What the last period saw and commanded, for telemetry and for the next period's decisions.
//!
//! Its phase is the one these values belong to; the drive's own, `State::phase`, may already be the next.

use siskin_units::math::TopProduct;
use siskin_units::{AdcCounts, Angle, Current, Speed, Voltage, traced};

use super::phase::Phase;
use crate::control::modulator::Supply;
use crate::control::transform::Dq;

traced! {
    /// The last period's quantities.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub(super) struct Seen {
        /// The drive's phase.
        pub(super) phase: Phase,
        /// Electrical angle of the control's frame at the sample, for the phase order a, b, c.
        pub(super) angle: Angle,
        /// Electrical speed in the direction of rotation.
        pub(super) speed: Speed,
        /// Measured current in the frame.
        pub(super) i: Dq<Current>,
        /// Commanded voltage in the frame.
        pub(super) u: Dq<Voltage>,
        /// Current from the supply.
        pub(super) bus_current: Current,
    }
}

impl Seen {
    /// A standing shaft, without current and voltage.
    pub(super) const NOTHING: Self = Self {
        phase: Phase::Idle,
        angle: Angle::ZERO,
        speed: Speed::ZERO,
        i: Dq {
            d: Current::ZERO,
            q: Current::ZERO,
        },
        u: Dq {
            d: Voltage::ZERO,
            q: Voltage::ZERO,
        },
        bus_current: Current::ZERO,
    };

    /// Clears current and voltage: the bridge is off, or the low sides are on.
    pub(super) fn rest(&mut self) {
        self.i = Dq::default();
        self.u = Dq::default();
        self.bus_current = Current::ZERO;
    }
}

/// Converts a phase reading to a current: one unit is 4096/3 counts.
pub(super) fn reading(counts: AdcCounts) -> Current {
    Current::from_bits(counts.to_bits().saturating_mul(3))
}

/// Returns the largest magnitude of three currents.
pub(super) fn greatest([a, b, c]: [Current; 3]) -> Current {
    a.saturating_abs()
        .max(b.saturating_abs())
        .max(c.saturating_abs())
}

/// Returns the current from the supply: 1.5·(v·i)/V_bus.
pub(super) fn bus_current(u: Dq<Voltage>, i: Dq<Current>, supply: &Supply) -> Current {
    // 24 + 28 − 32 fraction bits; 28 wanted.
    let two_thirds: Current = (u.d.top(i.d) + u.q.top(i.q))
        .top(supply.reciprocal)
        .scaled();
    two_thirds + (two_thirds >> 1)
}
