//! What a board says of its signals.

/// The place of a reading: a converter and the rank in its sequence.
#[derive(Clone, Copy)]
pub(crate) struct Slot(pub(crate) usize, pub(crate) usize);

/// The wiring of a board's signals to the converters and pins.
pub(crate) struct Wiring {
    /// Currents of the phases a, b, c; a phase without a shunt has none.
    pub(crate) currents: [Option<Slot>; 3],
    /// Nominal reading without current, counts: the drive measures what it really is.
    pub(crate) zero: i32,
    /// True if a reading rises with the current into the motor.
    pub(crate) rises: bool,
    /// Voltages of the terminals a, b, c.
    pub(crate) terminals: [Slot; 3],
    /// The supply.
    pub(crate) bus: Slot,
    /// The Hall sensors' first pin of port B, with the others after it, if there are any.
    pub(crate) hall: Option<u8>,
}

/// The pins of a gate driver on port C.
#[derive(Clone, Copy)]
pub(crate) struct GateDriverPins {
    /// Enables it, high.
    pub(crate) enable: usize,
    /// Its alarm, low.
    pub(crate) fault: usize,
}
