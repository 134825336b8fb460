//! Coefficients of the six-step drive.

use fixed::types::I1F31;
use siskin_params::Delay;
use siskin_units::math::Gain;
use siskin_units::{AdcCounts, Angle, Current, Speed, Voltage};

use crate::control::planner;
use crate::control::six_step::{crossing, duty};

/// Consecutive sextants without a crossing after which the rotor is lost: two turns.
pub(crate) const LOST_SEXTANTS: u8 = 12;

/// Patience with a rotor whose back-EMF has been seen: on its way to the crossing, or swinging back from a wrong one.
pub(crate) const PATIENCE_SEEN: u16 = 16;

/// Coefficients of the six-step drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// From a terminal's ADC counts to voltage.
    pub terminal: Gain<AdcCounts, Voltage>,
    /// Zero crossings.
    pub crossing: crossing::Config,
    /// From the command to ω*, every period of the outer loop.
    pub planner: planner::Config,
    /// The outer loop.
    pub duty: duty::Config,
    /// Largest duty at speed.
    pub whole: I1F31,
    /// Speed from which a leg may stay at the supply.
    pub whole_from: Speed,
    /// Speed at which the duty is held: the fastest that the samples follow.
    pub fastest: Speed,
    /// From what is left to that speed to the largest duty.
    pub hold: Gain<Speed, I1F31>,
    /// From the duty beyond that of a leg that switches to the commutation's advance.
    pub advance: Gain<I1F31, Angle>,
    /// From the sample to the commutation it leads to.
    pub delay: Delay,
    /// Largest current against the rotation. While braking, a released phase's back-EMF sustains
    /// its current, and a large one would hide every crossing.
    pub braking: Current,
    /// Current in Ramp.
    pub start_current: Current,
    /// Largest current of a motor test.
    pub test_current: Current,
    /// Samples for which Ramp waits where it has seen no back-EMF; where it has, `PATIENCE_SEEN` times as long.
    pub patience: u16,
    /// Periods after which a start's first Ramp without a full turn of consecutive crossings has failed; each further
    /// one has twice the time.
    pub astray: u16,
    /// Speed at which Run may begin.
    pub run_speed: Speed,
    /// Speed below which Run ends.
    pub slow: Speed,
}
