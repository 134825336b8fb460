//! VESC 4.10 class: two low-side shunts through the gate driver's amplifiers.

use siskin_control::control::delay::Delay;
use siskin_control::control::sensing::Shunts;
use siskin_control::params::{Board, Greatest, LeastDeadTime};
use siskin_control::protection::Ntc;

use crate::image;

/// Board name, in the image and for MAVLink.
pub const NAME: &str = "vesc4-f405";

/// Volts per count: 12 bits over the 3.3 V supply.
pub const V_PER_COUNT: f32 = 3.3 / 4096.0;

/// Low-side shunt of each measured phase.
pub const SHUNT_OHM: f32 = 0.001;

/// Gain of the gate driver's amplifiers.
pub const GAIN: f32 = 10.0;

/// Nominal zero-current reading, counts: the amplifiers' reference is half the supply.
pub const ZERO_COUNTS: i32 = 2048;

/// Gain from the supply, and from a terminal, to the converter.
pub const DIVIDER: f32 = 2.2 / (2.2 + 39.0);

/// The board as the control needs to know it. Its times are estimates until measured.
pub const BOARD: Board = Board {
    image: image::identity(NAME, 2),
    current_a_per_count: V_PER_COUNT / (SHUNT_OHM * GAIN),
    bus_v_per_count: V_PER_COUNT / DIVIDER,
    terminal_v_per_count: V_PER_COUNT / DIVIDER,
    shunts: Shunts::Two,
    // The converter's range is ±165 A about mid-scale.
    current_range_a: 120.0,
    greatest_phase: Greatest {
        value: 83.1,
        refusal: "above this board's 83.1 A",
    },
    // As in the VESC firmware for this class; the converter ends at 61.8 V, and the DRV8302 is for 60 V.
    greatest_supply: Greatest {
        value: 57.0,
        refusal: "above this board's 57 V",
    },
    // Duties computed in one period apply from the next counter top on.
    delay: Delay::One,
    // Half of the sampling window, 0.36 µs, and 1.5 µs of amplifier settling before the top.
    low_side_on_s: 3.7e-6,
    // The DRV8302's bootstrap capacitors charge through its diodes, without resistors.
    refresh_s: 1.0e-6,
    charge_s: 50e-6,
    // As in the VESC firmware for this class; the DRV8302 adds some, set by strap DTC.
    least_dead_time: LeastDeadTime {
        ns: 360.0,
        refusal: "below this board's 360 ns",
    },
    pwm_bounds: &[],
};

/// The transistors' thermistor.
pub const NTC: Ntc = Ntc::VESC;
