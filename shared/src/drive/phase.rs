//! Phases of the drive.

use siskin_units::trace::Trace;

/// A phase of the drive (start-up: second paper, section 3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// No drive; the bridge is off.
    Idle,
    /// Bridge off while the current offsets are measured and the rotor is searched for.
    Sense,
    /// The low sides charge the supplies of the high-side drivers.
    Charge,
    /// The rotor is being aligned; field-oriented only.
    Park,
    /// The current vector accelerates and the rotor follows; six-step seeks the rotor by turning it.
    Ramp,
    /// The observer knows the rotor's position: field-oriented control.
    Run,
    /// The shaft coasts without torque or is braked to a stop.
    Stopping,
    /// All low sides are on.
    Brake,
    /// The phases switch to be heard or tested; the rotor stands.
    Tone,
}

impl Phase {
    /// Every phase, in numerical order.
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

    /// Returns true if the motor is driven or slowed down.
    pub fn drives(self) -> bool {
        matches!(self, Self::Park | Self::Ramp | Self::Run | Self::Stopping)
    }
}

impl Trace for Phase {
    fn trace(&self, out: &mut impl FnMut(u32)) {
        out(*self as u32);
    }
}
