//! Phases of the drive.

use crate::trace::Trace;

/// Phase of the drive (start-up: second paper, section 3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// No drive; the bridge is off.
    Idle,
    /// The bridge is off while the currents' zeros are measured and the rotor is looked for.
    Sense,
    /// The low sides charge the supplies of the high sides' drivers.
    Charge,
    /// The rotor is being aligned.
    Park,
    /// The current's vector turns faster and faster and the rotor follows.
    Ramp,
    /// The observer knows the rotor's position: field-oriented control.
    Run,
    /// The shaft coasts without torque or is slowed down to be stopped.
    Stopping,
    /// All low sides are on.
    Brake,
    /// The phases switch to be heard, or to be tested; the rotor stands.
    Tone,
}

impl Phase {
    /// Every phase, in the order of their numbers.
    pub const ALL: [Self; 9] = [
        Self::Idle,
        Self::Sense,
        Self::Charge,
        Self::Park,
        Self::Ramp,
        Self::Run,
        Self::Stopping,
        Self::Brake,
        Self::Tone,
    ];

    /// Returns true if the control's frame is imposed on the rotor.
    pub(super) fn is_open_loop(self) -> bool {
        matches!(self, Self::Park | Self::Ramp)
    }

    /// Returns true if all switches are off.
    pub(super) fn is_off(self) -> bool {
        matches!(self, Self::Idle | Self::Sense)
    }

    /// Returns true if the motor is turned, or slowed down.
    pub fn drives(self) -> bool {
        matches!(self, Self::Park | Self::Ramp | Self::Run | Self::Stopping)
    }
}

impl Trace for Phase {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        out(*self as u32);
    }
}
