//! State of the six-step drive.

use fixed::types::I36F28;

use crate::control::planner;
use crate::control::six_step::commutation::Sector;
use crate::control::six_step::{crossing, duty, tracking};
use crate::trace::traced;
use crate::units::Current;

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
    /// Ends a drive.
    pub(in crate::drive) fn rest(&mut self) {
        self.still = 0;
        self.missed = 0;
        self.planner = planner::State::default();
    }
}
