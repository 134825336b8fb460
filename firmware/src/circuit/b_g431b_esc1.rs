//! B-G431B-ESC1: three low-side shunts through the chip's own op-amps, 6S, 40 A peak.

use siskin_control::control::delay::Delay;
use siskin_control::control::sensing::Shunts;
use siskin_control::params::Board;
use siskin_control::protection::Ntc;

use crate::image;

/// The board's name, in its image and for MAVLink.
pub const NAME: &str = "b-g431b-esc1";

/// Volts of one count: 12 bits of the 3.3 V supply.
pub const V_PER_COUNT: f32 = 3.3 / 4096.0;

/// Each phase's shunt in the low side.
pub const SHUNT_OHM: f32 = 0.003;

/// From the shunt to the op-amp's input, by its resistors.
pub const SHUNT_DIVIDER: f32 = 4.0 / 7.0;

/// The op-amp's.
pub const GAIN: f32 = 16.0;

/// From the supply to the converter.
pub const BUS_DIVIDER: f32 = 18.0 / (18.0 + 169.0);

/// From a terminal to the converter, while PB5 holds the lower resistors at ground: it ends at
/// 18.3 V.
pub const TERMINAL_DIVIDER: f32 = 2.2 / (2.2 + 10.0);

/// The board's rating, peak amperes. The converter shows more: ±60 A about the middle of its range.
pub const RATING_A: f32 = 40.0;

/// What the control must know of this board.
pub const BOARD: Board = Board {
    image: image::identity(NAME, 1),
    current_a_per_count: V_PER_COUNT / (SHUNT_OHM * SHUNT_DIVIDER * GAIN),
    bus_v_per_count: V_PER_COUNT / BUS_DIVIDER,
    terminal_v_per_count: V_PER_COUNT / TERMINAL_DIVIDER,
    shunts: Shunts::Three,
    current_range_a: RATING_A,
    // The duties computed in one period are applied from the next counter's top on.
    delay: Delay::One,
    // The first sampling window is centred on the counter's top, so half of it (0.15 µs) and 1 µs
    // for the amplifier to settle must fit before the top: an estimate until it is measured.
    low_side_on_s: 2.3e-6,
    // The MOSFETs' gates take up to 80 nC a period, which the L6387 gives back to the bootstrap
    // capacitor through 125 Ω while the low side is on: 3 V less of gate supply with this, in a
    // phase that stays at the greatest duty. It also leaves 2.15 µs after the top with the default
    // dead time, by when the terminals have been sampled.
    refresh_s: 3.3e-6,
    // Five time constants of 125 Ω and 100 nF.
    charge_s: 63e-6,
};

/// The thermistor: 10 kΩ at 25 °C over 4.7 kΩ, which are 1.055 V at 25 °C as ST's motor control kit
/// has it for this board; its β is that of the usual part.
pub const NTC: Ntc = Ntc {
    pull_down: 0.47,
    beta_k: 3380.0,
};
