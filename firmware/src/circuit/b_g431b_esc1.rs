//! B-G431B-ESC1: three low-side shunts through the chip's own op-amps, 6S, 40 A peak.

use siskin_control::control::delay::Delay;
use siskin_control::control::sensing::Shunts;
use siskin_control::params::{Board, LeastDeadTime};
use siskin_control::protection::Ntc;

use crate::image;

/// The board's name, in its image and for MAVLink.
pub const NAME: &str = "b-g431b-esc1";

/// Volts of one count: 12 bits of the 3.3 V supply.
pub const V_PER_COUNT: f32 = 3.3 / 4096.0;

/// Each phase's shunt in the low side.
pub const SHUNT_OHM: f32 = 0.003;

/// Siemens times 1000 from an op-amp's input to its shunt, to ground and to the 3.3 V supply: 1.5 kΩ,
/// 2.2 kΩ and 22 kΩ (schematic of the MB1419, shunt sensing circuit).
const INPUT_MS: [f32; 3] = [1.0 / 1.5, 1.0 / 2.2, 1.0 / 22.0];

/// Of all three.
const INPUT_SUM_MS: f32 = INPUT_MS[0] + INPUT_MS[1] + INPUT_MS[2];

/// From the shunt to the op-amp's input: 4/7.
pub const SHUNT_DIVIDER: f32 = INPUT_MS[0] / INPUT_SUM_MS;

/// Volts at the op-amp's input without current: 0.1286.
pub const BIAS_V: f32 = 3.3 * INPUT_MS[2] / INPUT_SUM_MS;

/// The op-amp's, from the shunt's ground: 16 times the input less 15 times the ground (RM0440, PGA with
/// inverting input 0 and bias). So are ST's motor-control project, SimpleFOC and Recoil set up for this board.
///
/// That ground comes to the op-amp without a resistor (schematic, Vshunt−), so zero and gain are those
/// of the resistors at its input: 2.06 V, and 16 · 4/7 = 64/7 of the shunt's voltage, as SimpleFOC has
/// it. What changes is a shift of the ground against the chip's: a millivolt read as 0.56 A, or as 0.33 A
/// if the 2.2 kΩ should end at the chip's ground, and now reads as 0.014 A, or −0.21 A.
pub const GAIN: f32 = 16.0;

/// Nominal reading without current: 2553 counts, of 2.06 V.
pub const ZERO_COUNTS: i32 = (BIAS_V * GAIN / V_PER_COUNT + 0.5) as i32;

/// From the supply to the converter.
pub const BUS_DIVIDER: f32 = 18.0 / (18.0 + 169.0);

/// From a terminal to the converter, while PB5 holds the lower resistors at ground: it ends at
/// 18.3 V.
pub const TERMINAL_DIVIDER: f32 = 2.2 / (2.2 + 10.0);

/// The board's rating, peak amperes. The converter shows more: 75 A into the motor, 45 A out of it.
pub const RATING_A: f32 = 40.0;

/// The board as the control must know it.
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
    // phase that stays at the greatest duty. It also leaves 2.4 µs after the top with the least
    // dead time, by when the terminals have been sampled.
    refresh_s: 3.3e-6,
    // Five time constants of the L6387E's 125 Ω and 1.6 µF. ST's motor control holds the low sides on for
    // 10 ms at each start, whatever the capacitors.
    charge_s: 1e-3,
    // The L6387E has none of its own, and 33 Ω stand before gates of 80 nC: as ST's motor-control project
    // and Recoil have it for this board, DTG 128 of 170 MHz.
    least_dead_time: LeastDeadTime {
        ns: 750.0,
        refusal: "below this board's 750 ns",
    },
};

/// The thermistor: 10 kΩ at 25 °C over 4.7 kΩ, which are 1.055 V at 25 °C as ST's motor control kit
/// has it for this board; its β is that of the usual part.
pub const NTC: Ntc = Ntc {
    pull_down: 0.47,
    beta_k: 3380.0,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_of_a_dead_time_names_the_least() {
        for least in [BOARD, super::super::vesc4_f405::BOARD].map(|board| board.least_dead_time) {
            assert!(least.refusal.contains(&format!(" {} ns", least.ns)));
            // Behind the parameter's name in a text of 50 bytes, with what has been done.
            assert!("PWM_DEADTIME_NS , raised".len() + least.refusal.len() <= 50);
        }
    }

    #[test]
    fn the_zero_is_the_one_that_a_board_has_shown() {
        // The three op-amps' means of 4096 readings without current, with a gain of 2 (bench log of
        // aleonsa/tesis_maestria).
        for shown in [317.0, 317.0, 319.0] {
            let wanted = shown * GAIN / 2.0;
            let off = ZERO_COUNTS as f32 / wanted - 1.0;
            assert!(off.abs() < 0.02, "{ZERO_COUNTS} of {wanted}");
        }
    }

    #[test]
    fn the_range_is_shown_to_both_sides_of_any_sound_zero() {
        // An offset of a tenth of the range is the greatest that is taken for sound.
        let range = (1.1 * BOARD.current_range_a / BOARD.current_a_per_count) as i32;
        assert!(ZERO_COUNTS - range > 0);
        assert!(ZERO_COUNTS + range < 4095);
    }

    #[test]
    fn an_amplifier_at_a_rail_is_no_sound_zero() {
        let sound = (0.1 * BOARD.current_range_a / BOARD.current_a_per_count) as i32;
        // Within 100 mV of its rails.
        let near = (0.1 / V_PER_COUNT) as i32;
        assert!(ZERO_COUNTS - sound > near);
        assert!(ZERO_COUNTS + sound < 4095 - near);
    }
}
