//! Coefficients of the six-step drive.

use fixed::types::I36F28;

use crate::control::delay::Delay;
use crate::control::planner;
use crate::control::six_step::{crossing, duty};
use crate::math::Gain;
use crate::units::{AdcCounts, Current, Speed, Voltage};

/// Consecutive sextants without a crossing after which the rotor is lost: two turns.
pub(crate) const LOST_SEXTANTS: u8 = 12;

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
    /// From the sample to the commutation it leads to.
    pub delay: Delay,
    /// Largest current against the rotation. While braking, a released phase's back-EMF sustains
    /// its current, and a large one would hide every crossing.
    pub braking: Current,
    /// Current in Park and Ramp.
    pub start_current: Current,
    /// Largest current of a motor test.
    pub test_current: Current,
    /// Current times periods for which Park holds its first angle; it holds the second twice as
    /// long.
    pub park_charge: I36F28,
    /// From current to the change of Ramp's speed per period.
    pub ramp: Gain<Current, Speed>,
    /// Samples for which Ramp waits for a crossing.
    pub patience: u16,
    /// Periods after which a Ramp without a full turn of consecutive crossings has failed.
    pub astray: u16,
    /// Speed at which Run may begin.
    pub run_speed: Speed,
    /// Speed below which Run ends.
    pub slow: Speed,
}
