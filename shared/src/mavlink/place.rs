//! The ESC's number in its vehicle, and its slot in messages for four ESCs.

use mavlink::dialects::ardupilotmega::{
    ESC_TELEMETRY_1_TO_4_DATA, ESC_TELEMETRY_5_TO_8_DATA, ESC_TELEMETRY_9_TO_12_DATA,
    ESC_TELEMETRY_13_TO_16_DATA,
};

use super::payload::id_of;

/// Component ids of servos and motor controllers, `MAV_COMP_ID_SERVO1` to `_SERVO14`.
const FIRST_COMPONENT: u8 = 140;
const LAST_COMPONENT: u8 = 153;

/// ESCs in one message.
pub(super) const SLOTS: usize = 4;

/// The number of an ESC, 0 to 13.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place(u8);

impl Place {
    /// The only ESC, or one that its component id does not number.
    pub(super) const FIRST: Self = Self(0);

    /// Returns the place of a peripheral: component 140 is the first.
    pub(super) const fn of_component(component: u8) -> Self {
        match Self::number_of_component(component) {
            Some(number) => Self(number),
            None => Self::FIRST,
        }
    }

    /// Returns the number of an ESC if its component id gives it one.
    pub(super) const fn number_of_component(component: u8) -> Option<u8> {
        match component {
            FIRST_COMPONENT..=LAST_COMPONENT => Some(component - FIRST_COMPONENT),
            _ => None,
        }
    }

    /// Returns `index` of `ESC_INFO` and `ESC_STATUS`: the number of the ESC in their first slot.
    pub(super) const fn index(self) -> u8 {
        self.0 - self.0 % SLOTS as u8
    }

    /// Returns the least number of ESCs that there can be.
    pub(super) const fn count(self) -> u8 {
        self.0 + 1
    }

    /// Returns its bit in `ESC_INFO.info`.
    pub(super) const fn online(self) -> u8 {
        if self.0 < 8 { 1 << self.0 } else { 0 }
    }

    /// Returns the `ACTUATOR_OUTPUT_FUNCTION` of its motor.
    pub(super) fn motor_function(self) -> f32 {
        f32::from(self.0 + 1)
    }

    /// Returns the place of another slot of the same four.
    pub(super) const fn beside(self, slot: usize) -> Self {
        Self(self.index() + slot as u8)
    }

    /// Returns its slot in an array of [`SLOTS`].
    pub(super) fn slot(self) -> usize {
        usize::from(self.0) % SLOTS
    }

    /// Returns id and CRC seed of the `ESC_TELEMETRY_*` message with its slot; all have the same
    /// layout.
    pub(super) const fn telemetry(self) -> (u32, u8) {
        match self.index() {
            0 => id_of::<ESC_TELEMETRY_1_TO_4_DATA>(),
            4 => id_of::<ESC_TELEMETRY_5_TO_8_DATA>(),
            8 => id_of::<ESC_TELEMETRY_9_TO_12_DATA>(),
            _ => id_of::<ESC_TELEMETRY_13_TO_16_DATA>(),
        }
    }
}
