//! State of the six-step drive.

use fixed::types::{I1F31, I36F28};

use crate::control::PERIODS;
use crate::control::planner;
use crate::control::six_step::commutation::Sector;
use crate::control::six_step::{crossing, duty, tracking};
use crate::control::speed::Bounds;
use crate::trace::traced;
use crate::units::Current;

/// The periods, of [`PERIODS`], in which pieces of the outer loop are due. Every second one has none: a piece waits there for
/// the end of what a crossing or a commutation takes.
pub(super) mod slot {
    /// The mode, from the set-point.
    pub(in crate::drive::six_step) const MODE: u8 = 0;
    /// From the set-point to the wanted duty and the current's bounds.
    pub(in crate::drive::six_step) const DEMAND: u8 = 2;
    /// Currents and voltages for telemetry.
    pub(in crate::drive::six_step) const SEEN: u8 = 4;
    /// Bounds from the supply's current.
    pub(in crate::drive::six_step) const SUPPLY: u8 = 6;
    /// One without a piece.
    pub(in crate::drive::six_step) const NOTHING: u8 = 1;
}

/// Park first holds the rotor along phase c, at 240°.
pub(super) const FIRST_PARK: Sector = Sector::Cb;

traced! {
    /// State of the six-step drive.
    #[derive(Clone, Debug, PartialEq)]
    pub(in crate::drive) struct State {
        pub(super) sector: Sector,
        pub(super) crossing: crossing::State,
        pub(in crate::drive) tracking: tracking::State,
        pub(super) duty: duty::State,
        /// The duty to move to, as far as the bounds permit.
        pub(super) wanted: I1F31,
        /// The current's bounds.
        pub(super) bounds: Bounds,
        /// The period's place among [`PERIODS`].
        pub(super) slot: u8,
        /// The last slot whose piece waits.
        pub(super) due: u8,
        /// A crossing was found in this period, or it ended a sextant.
        pub(super) is_busy: bool,
        /// ∫i dt at the present angle of Park.
        pub(super) charge: I36F28,
        /// Current induced by the rotor's swing in Park, smoothed; positive forwards.
        pub(super) swing: Current,
        /// The rotor certainly swings forwards.
        pub(super) swings_forwards: bool,
        /// Periods since Ramp last tracked the rotor.
        pub(super) astray: u16,
        /// Consecutive periods without current while the low sides are on.
        pub(super) still: u16,
        /// Consecutive sextants without a crossing.
        pub(in crate::drive) missed: u8,
        /// ω* and its trajectory.
        pub(in crate::drive) planner: planner::State,
    }
}

impl Default for State {
    fn default() -> Self {
        Self {
            sector: FIRST_PARK,
            crossing: crossing::State::default(),
            tracking: tracking::State::default(),
            duty: duty::State::default(),
            wanted: I1F31::ZERO,
            bounds: Bounds::default(),
            slot: slot::NOTHING,
            due: slot::NOTHING,
            is_busy: false,
            charge: I36F28::ZERO,
            swing: Current::ZERO,
            swings_forwards: false,
            astray: 0,
            still: 0,
            missed: 0,
            planner: planner::State::default(),
        }
    }
}

impl State {
    /// Begins a period: takes the next slot.
    pub(super) fn next(&mut self) {
        self.slot = (self.slot + 1) % PERIODS as u8;
        if self.slot.is_multiple_of(2) {
            self.due = self.slot;
        }
        self.is_busy = false;
    }

    /// Makes the outer loop begin in the next period.
    pub(super) fn plan_next(&mut self) {
        self.slot = slot::DEMAND - 1;
    }

    /// Returns true if a piece is due now.
    pub(super) fn is_due(&self) -> bool {
        self.due != slot::NOTHING && !self.is_busy
    }

    /// Returns the slot whose piece is due.
    pub(super) fn take_due(&mut self) -> u8 {
        core::mem::replace(&mut self.due, slot::NOTHING)
    }

    /// Returns true if the last period had nothing to do but to look for a crossing and to bound the current.
    pub(in crate::drive) fn has_done_little(&self) -> bool {
        !self.slot.is_multiple_of(2) && !self.is_busy
    }

    /// Ends a drive.
    pub(in crate::drive) fn rest(&mut self) {
        self.still = 0;
        self.missed = 0;
        self.planner = planner::State::default();
    }
}
