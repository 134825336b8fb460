//! What the six-step drive remembers.

use fixed::types::I36F28;

use super::start::FIRST_PARK;
use crate::control::planner;
use crate::control::six_step::commutation::Sector;
use crate::control::six_step::{crossing, duty, tracking};
use crate::trace::Trace;
use crate::units::{Current, Voltage};

/// What the six-step drive remembers.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    pub(super) sector: Sector,
    pub(super) crossing: crossing::State,
    pub(super) tracking: tracking::State,
    pub(super) duty: duty::State,
    /// ∫i dt since the present angle of Park.
    pub(super) charge: I36F28,
    /// What the rotor's swing in Park induces, smoothed; positive forwards.
    pub(super) swing: Current,
    /// It is certain that it swings forwards.
    pub(super) swings_forwards: bool,
    /// Periods of Ramp since it has last followed the rotor.
    pub(super) astray: u16,
    /// Periods in a row without a current while the low sides are on.
    pub(super) still: u16,
    /// Sextants in a row without a crossing.
    pub(super) missed: u8,
    /// Starts in a row that have failed.
    pub(super) failed: u8,
    /// ω* and where it goes.
    pub(in crate::drive) planner: planner::State,
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
            failed: 0,
            planner: planner::State::default(),
        }
    }
}

impl State {
    /// Starts in a row that have failed, and sextants in a row without a crossing.
    pub(in crate::drive) fn trouble(&self) -> (u8, u8) {
        (self.failed, self.missed)
    }

    /// Every word of the state.
    pub fn trace(&self, out: &mut impl FnMut(u32)) {
        let Self {
            sector,
            crossing:
                crossing::State {
                    samples,
                    side,
                    run,
                    below,
                    above,
                    found,
                    slope,
                },
            tracking:
                tracking::State {
                    delta,
                    omega,
                    acceleration,
                    omega_bar,
                    elapsed,
                    sextants,
                    from_rest,
                    crossings,
                },
            duty:
                duty::State {
                    duty,
                    sigma,
                    smoothed,
                    peak,
                },
            charge,
            swing,
            swings_forwards,
            astray,
            still,
            missed,
            failed,
            planner,
        } = self;
        let (first, last) = above.map_or(((0, 0), (0, 0)), |span| {
            let word = |(at, reading): (u16, Voltage)| (i32::from(at), reading.to_bits());
            (word(span.first), word(span.last))
        });
        let charge = charge.to_bits();
        let words: [i32; 31] = [
            *sector as i32,
            i32::from(*samples),
            i32::from(*side),
            i32::from(*run),
            i32::from(*below),
            first.0,
            first.1,
            last.0,
            last.1,
            i32::from(*found),
            slope.to_bits(),
            delta.to_bits(),
            omega.to_bits(),
            acceleration.to_bits(),
            omega_bar.to_bits(),
            elapsed.to_bits(),
            i32::from(*sextants),
            i32::from(*from_rest),
            i32::from(*crossings),
            duty.to_bits(),
            sigma.to_bits(),
            smoothed.to_bits(),
            peak.to_bits(),
            charge as i32,
            (charge >> 32) as i32,
            swing.to_bits(),
            i32::from(*swings_forwards),
            i32::from(*astray),
            i32::from(*still),
            i32::from(*missed),
            i32::from(*failed),
        ];
        words.into_iter().for_each(|word| out(word as u32));
        planner.trace(out);
    }
}
