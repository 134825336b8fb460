//! Describes how a board's signals are connected.

use crate::hall;

/// Where a reading is: a converter and the rank in its sequence.
#[derive(Clone, Copy)]
pub(crate) struct Slot(pub(crate) usize, pub(crate) usize);

/// Connections of a board's signals to converters and pins.
pub(crate) struct Wiring {
    /// Currents of phases a, b, c; `None` without a shunt.
    pub(crate) currents: [Option<Slot>; 3],
    /// Nominal zero-current reading, counts; the drive measures the actual one.
    pub(crate) zero: i32,
    /// Readings rise with current into the motor.
    pub(crate) rises: bool,
    /// Terminal voltages a, b, c.
    pub(crate) terminals: [Slot; 3],
    /// Supply voltage.
    pub(crate) bus: Slot,
    /// Pins of the Hall sensors. Sensor and phase of a number belong together: a builder expects the first sensor
    /// at the first output.
    pub(crate) hall: hall::Pins,
}

/// Pins of a gate driver on port C.
#[derive(Clone, Copy)]
pub(crate) struct GateDriverPins {
    /// Enable, active high.
    pub(crate) enable: usize,
    /// Fault (nFAULT), active low.
    pub(crate) fault: usize,
}
