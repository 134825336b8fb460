//! VESC 4.10 class: two low-side shunts through the gate driver's amplifiers.

use siskin_control::control::delay::Delay;
use siskin_control::control::sensing::Shunts;
use siskin_control::params::{Board, LeastDeadTime};
use siskin_control::protection::Ntc;

use crate::image;

/// The board's name, in its image and for MAVLink.
pub const NAME: &str = "vesc4-f405";

/// Volts of one count: 12 bits of the 3.3 V supply.
pub const V_PER_COUNT: f32 = 3.3 / 4096.0;

/// Each measured phase's shunt in the low side.
pub const SHUNT_OHM: f32 = 0.001;

/// The gate driver's amplifiers.
pub const GAIN: f32 = 10.0;

/// Nominal reading without current, counts: the amplifiers' reference is half the supply.
pub const ZERO_COUNTS: i32 = 2048;

/// From the supply to the converter, and from a terminal.
pub const DIVIDER: f32 = 2.2 / (2.2 + 39.0);

/// The board as the control must know it. Its times are estimates until they are measured.
pub const BOARD: Board = Board {
    image: image::identity(NAME, 2),
    current_a_per_count: V_PER_COUNT / (SHUNT_OHM * GAIN),
    bus_v_per_count: V_PER_COUNT / DIVIDER,
    terminal_v_per_count: V_PER_COUNT / DIVIDER,
    shunts: Shunts::Two,
    // The converter shows ±165 A about the middle of its range.
    current_range_a: 120.0,
    // The duties computed in one period are applied from the next counter's top on.
    delay: Delay::One,
    // Half of the sampling window, 0.36 µs, and 1.5 µs for the amplifier to settle before the top.
    low_side_on_s: 3.7e-6,
    // The DRV8302's bootstrap capacitors are charged through its diodes, without resistors.
    refresh_s: 1.0e-6,
    charge_s: 50e-6,
    // As the VESC's own firmware has it for this class; the DRV8302 adds some by its strap DTC.
    least_dead_time: LeastDeadTime {
        ns: 360.0,
        refusal: "below this board's 360 ns",
    },
};

/// The transistors' thermistor.
pub const NTC: Ntc = Ntc::VESC;
