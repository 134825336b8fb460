//! Coefficients of the tones.

use fixed::types::I1F31;
use siskin_units::math::Gain;
use siskin_units::{Current, Speed, Voltage};

/// Highest pitch, turns per period: with eight samples per cycle the largest is at most 8 % below
/// the current's peak.
pub const PITCH_MAX: Speed = Speed::lit("0.125");

/// Coefficients of the tones.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Target for the largest phase current's peak.
    pub peak: Current,
    /// From current to its share of that peak.
    pub share: Gain<Current, I1F31>,
    /// R times the peak.
    pub resistive: Voltage,
    /// From pitch to ωL times the peak.
    pub reactive: Gain<Speed, Voltage>,
    /// Voltage that the dead time takes from a vector along a phase, as a share of the supply.
    pub dead: I1F31,
}
