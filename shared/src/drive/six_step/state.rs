//! State of the six-step drive.

use fixed::types::I1F31;
use siskin_units::{Angle, traced};

use crate::control::PERIODS;
use crate::control::planner;
use crate::control::six_step::commutation::{HALF_SEXTANT, Sector};
use crate::control::six_step::{crossing, duty, tracking};
use crate::control::speed::Bounds;

/// The pieces of the outer loop. In [`PERIODS`] each falls due once, in every second period; it waits for the end of what a
/// crossing, a commutation or a piece before it takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Piece {
    /// From the set-point to the wanted duty and the current's bounds.
    Demand,
    /// Currents and voltages for telemetry.
    Seen,
    /// Bounds from the supply's current.
    Supply,
    /// The mode, from the set-point.
    Mode,
}

impl Piece {
    const ALL: [Self; PERIODS as usize / 2] = [Self::Demand, Self::Seen, Self::Supply, Self::Mode];
}

/// The first sextant of a start. Its phase rises: a rotor at rest looks like one before its crossing, and not like one past
/// it.
pub(super) const FIRST: Sector = Sector::Ba;

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
        /// The largest duty.
        pub(super) most: I1F31,
        /// The integral of what bounds it at the fastest speed that is followed.
        pub(super) held: I1F31,
        /// The current's bounds.
        pub(super) bounds: Bounds,
        /// The period's place among [`PERIODS`].
        pub(super) slot: u8,
        /// The pieces that are due, a bit each.
        pub(super) due: u8,
        /// In this period a crossing was found, a sextant ended, or a piece was run.
        pub(super) is_busy: bool,
        /// Whether the switching leg stayed high in the last periods, a bit each, the last one lowest.
        pub(super) were_high: u8,
        /// The angle past its middle at which the sextant ends.
        pub(super) end: Angle,
        /// Samples without back-EMF since the last commutation, and after the one before.
        pub(super) hidden: [u16; 2],
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
            sector: FIRST,
            crossing: crossing::State::default(),
            tracking: tracking::State::at_rest(),
            duty: duty::State::default(),
            wanted: I1F31::ZERO,
            most: I1F31::ZERO,
            held: I1F31::ZERO,
            bounds: Bounds::default(),
            slot: 0,
            due: 0,
            is_busy: false,
            were_high: 0,
            end: HALF_SEXTANT,
            hidden: [0; 2],
            astray: 0,
            still: 0,
            missed: 0,
            planner: planner::State::default(),
        }
    }
}

impl State {
    /// Begins a period.
    pub(super) fn next(&mut self) {
        self.slot = (self.slot + 1) % PERIODS as u8;
        if self.slot.is_multiple_of(2) {
            self.due |= 1 << (self.slot / 2);
        }
        self.is_busy = false;
    }

    /// Makes a piece due in the next period.
    pub(super) fn ask(&mut self, piece: Piece) {
        self.due |= 1 << piece as u8;
    }

    /// Returns the piece to run in this period, if any.
    pub(super) fn take_due(&mut self) -> Option<Piece> {
        if self.is_busy {
            return None;
        }
        let piece = *Piece::ALL.get(self.due.trailing_zeros() as usize)?;
        self.due &= self.due - 1;
        self.is_busy = true;
        Some(piece)
    }

    /// Returns true if the last period had nothing to do but to look for a crossing and to bound the current.
    pub(in crate::drive) fn has_done_little(&self) -> bool {
        !self.is_busy
    }

    /// Ends a drive.
    pub(in crate::drive) fn rest(&mut self) {
        self.still = 0;
        self.missed = 0;
        self.planner = planner::State::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At four periods per sextant a crossing and a commutation may be in succession, always in the same slots.
    #[test]
    fn each_piece_has_its_turn_at_four_periods_per_sextant() {
        for first in 0..4 {
            let mut state = State::default();
            let mut turns = [0; Piece::ALL.len()];
            for period in 0..80 * PERIODS {
                state.next();
                state.is_busy = (period + first) % 4 < 2;
                if let Some(piece) = state.take_due() {
                    turns[piece as usize] += 1;
                }
            }
            assert!(turns.iter().all(|turns| *turns >= 79), "{first}: {turns:?}");
        }
    }
}
