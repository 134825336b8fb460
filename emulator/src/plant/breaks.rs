//! What can break in the power stage.

/// What is broken in a leg; switches are low and high.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LegBreaks {
    /// The wire to the motor is open.
    pub wire: bool,
    /// Switches that never turn on.
    pub open: [bool; 2],
    /// Switches that are always on.
    pub shorted: [bool; 2],
}

/// What is broken in each leg.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Breaks(pub [LegBreaks; 3]);
