//! Coefficients of the tones.

use fixed::types::I1F31;

use crate::math::Gain;
use crate::units::{Current, Speed, Voltage};

/// Highest pitch, turns a period: with eight samples a cycle the greatest of them is at most 8 %
/// below the current's peak.
pub const PITCH_MAX: Speed = Speed::lit("0.125");

/// Coefficients of the tones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Peak that the greatest phase current is led to.
    pub peak: Current,
    /// Current to its share of that.
    pub share: Gain<Current, I1F31>,
    /// R times the peak.
    pub resistive: Voltage,
    /// Pitch to ωL times the peak.
    pub reactive: Gain<Speed, Voltage>,
    /// Voltage that the dead time takes of a vector along a phase, as a share of the supply.
    pub dead: I1F31,
}
