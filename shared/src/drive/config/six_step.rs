//! Coefficients of the six-step drive.

use fixed::types::I36F28;

use crate::control::delay::Delay;
use crate::control::planner;
use crate::control::six_step::{crossing, duty};
use crate::math::Gain;
use crate::units::{AdcCounts, Current, Speed, Voltage};

/// Sextants in a row without a crossing after which the rotor is lost: two turns.
pub(crate) const LOST_SEXTANTS: u8 = 12;

/// Coefficients of the six-step drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Counts of a terminal's converter to voltage.
    pub terminal: Gain<AdcCounts, Voltage>,
    /// Zero crossings.
    pub crossing: crossing::Config,
    /// From the command to ω*, period by period.
    pub planner: planner::Config,
    /// The outer loop.
    pub duty: duty::Config,
    /// From the sample to the commutation that it leads to.
    pub delay: Delay,
    /// Greatest current against the rotation. Braking, a released phase's back-EMF holds up its
    /// current, and a large one would hide every crossing.
    pub braking: Current,
    /// Current of Park and Ramp.
    pub start_current: Current,
    /// Greatest current of a test of the motor.
    pub test_current: Current,
    /// Current times periods for which the first angle of Park is held; the second is held twice as
    /// long.
    pub park_charge: I36F28,
    /// Current to the change of Ramp's speed in a period.
    pub ramp: Gain<Current, Speed>,
    /// Samples for which Ramp waits for a crossing that is to come.
    pub patience: u16,
    /// Periods after which a Ramp that has not seen a turn of crossings in a row has failed.
    pub astray: u16,
    /// Speed at which Run may begin.
    pub run_speed: Speed,
    /// Speed below which Run ends.
    pub slow: Speed,
}
