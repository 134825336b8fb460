//! B-G431B-ESC1: three low-side shunts through on-chip op-amps, 6S, 40 A peak.

use siskin_control::protection::Ntc;
use siskin_params::{Board, Delay, Greatest, LeastDeadTime, ParamId, PwmBound, Shunts, parts};

use crate::image;

/// Board name, in the image and for MAVLink.
pub const NAME: &str = "b-g431b-esc1";

/// Volts per count: 12 bits over the 3.3 V supply.
pub const V_PER_COUNT: f32 = 3.3 / 4096.0;

/// Low-side shunt of each phase.
pub const SHUNT_OHM: f32 = 0.003;

/// Conductances in mS from an op-amp's input to its shunt, to ground and to the 3.3 V supply: 1.5 kΩ, 2.2 kΩ
/// and 22 kΩ (schematic of the MB1419, shunt sensing circuit).
const INPUT_MS: [f32; 3] = [1.0 / 1.5, 1.0 / 2.2, 1.0 / 22.0];

/// Sum of the three.
const INPUT_SUM_MS: f32 = INPUT_MS[0] + INPUT_MS[1] + INPUT_MS[2];

/// Gain from the shunt to the op-amp's input: 4/7.
pub const SHUNT_DIVIDER: f32 = INPUT_MS[0] / INPUT_SUM_MS;

/// Zero-current voltage at the op-amp's input: 0.1286 V.
pub const BIAS_V: f32 = 3.3 * INPUT_MS[2] / INPUT_SUM_MS;

/// Op-amp gain, relative to the shunt's ground: 16 times the input less 15 times the ground (RM0440, PGA with
/// inverting input 0 and bias). ST's motor-control project, SimpleFOC and Recoil set up this board the same
/// way.
///
/// That ground reaches the op-amp without a resistor (schematic, Vshunt−), so zero and gain are those of the
/// resistors at its input: 2.06 V, and 16 · 4/7 = 64/7 of the shunt's voltage, as in SimpleFOC. What it changes
/// is the effect of a shift of that ground against the chip's: a millivolt reads as 0.014 A instead of 0.56 A
/// or, if the 2.2 kΩ ends at the chip's ground, as −0.21 A instead of 0.33 A.
pub const GAIN: f32 = 16.0;

/// Nominal zero-current reading: 2553 counts, or 2.06 V.
pub const ZERO_COUNTS: i32 = (BIAS_V * GAIN / V_PER_COUNT + 0.5) as i32;

/// Gain from the supply to the converter.
pub const BUS_DIVIDER: f32 = 18.0 / (18.0 + 169.0);

/// Gain from a terminal to the converter, while PB5 grounds the lower resistors: full scale is 18.3 V.
pub const TERMINAL_DIVIDER: f32 = 2.2 / (2.2 + 10.0);

/// Current rating of the board, peak A. The converter's range is wider: 75 A into the motor, 45 A out of it.
pub const RATING_A: f32 = 40.0;

/// The drive that every image has. `tests/virtual-board` plays this bound and those below, and all other choices at the end
/// of the parameter's range.
const SIX_STEP_BOUND: PwmBound = PwmBound {
    choice: (ParamId::CtlDrive, 1.0),
    hz: 35_000.0,
    refusal: "at most 35000 in six-step",
};

const FIELD_ORIENTED_BOUND: PwmBound = PwmBound {
    choice: (ParamId::CtlDrive, 0.0),
    hz: 54_000.0,
    refusal: "at most 54000 field-oriented",
};

/// Those of an image with parts of the papers.
const PWM_BOUNDS: [PwmBound; 6] = [
    PwmBound {
        choice: (ParamId::CtlObserver, 1.0),
        hz: 30_000.0,
        refusal: "at most 30000 with CTL_OBSERVER 1",
    },
    PwmBound {
        choice: (ParamId::CtlObserver, 2.0),
        hz: 30_000.0,
        refusal: "at most 30000 with CTL_OBSERVER 2",
    },
    PwmBound {
        choice: (ParamId::CtlObserver, 0.0),
        hz: 36_000.0,
        refusal: "at most 36000 with CTL_OBSERVER 0",
    },
    PwmBound {
        choice: (ParamId::CtlRegulator, 2.0),
        hz: 50_000.0,
        refusal: "at most 50000 with CTL_REGULATOR 2",
    },
    SIX_STEP_BOUND,
    FIELD_ORIENTED_BOUND,
];

/// The board as the control needs to know it.
pub const BOARD: Board = Board {
    image: image::identity(NAME, 1),
    current_a_per_count: V_PER_COUNT / (SHUNT_OHM * SHUNT_DIVIDER * GAIN),
    bus_v_per_count: V_PER_COUNT / BUS_DIVIDER,
    terminal_v_per_count: V_PER_COUNT / TERMINAL_DIVIDER,
    shunts: Shunts::Three,
    current_range_a: RATING_A,
    greatest_phase: Greatest {
        value: 27.7,
        refusal: "above this board's 27.7 A",
    },
    // The converter ends at 34.27 V, and the board is for 6S.
    greatest_supply: Greatest {
        value: 33.0,
        refusal: "above this board's 33 V",
    },
    // Duties computed in one period apply from the next counter top on.
    delay: Delay::One,
    // The first sampling window is centred on the counter's top, so half of it (0.15 µs) and 1 µs of amplifier
    // settling must fit before the top: an estimate until measured.
    low_side_on_s: 2.3e-6,
    // The gates take up to 80 nC per period, which the L6387 returns to the bootstrap capacitor through 125 Ω
    // while the low side is on: with this time, 3 V less gate supply in a phase that stays at maximum duty. It
    // also leaves 2.4 µs after the top at minimum dead time, by when the terminals have been sampled.
    refresh_s: 3.3e-6,
    // Five time constants of the L6387E's 125 Ω and 1.6 µF. ST's motor control holds the low sides on for 10 ms
    // at each start, whatever the capacitors.
    charge_s: 1e-3,
    // The L6387E has no dead time of its own, and drives 80 nC gates through 33 Ω: DTG 128 at 170 MHz, as in
    // ST's motor-control project and Recoil for this board.
    least_dead_time: LeastDeadTime {
        ns: 750.0,
        refusal: "below this board's 750 ns",
    },
    pwm_bounds: match parts::CHOICE {
        parts::Choice::Flight => &[SIX_STEP_BOUND, FIELD_ORIENTED_BOUND],
        _ => &PWM_BOUNDS,
    },
};

/// The thermistor: 10 kΩ at 25 °C over 4.7 kΩ, giving 1.055 V at 25 °C as in ST's motor control kit for this
/// board; β is that of the usual part.
pub const NTC: Ntc = Ntc {
    pull_down: 0.47,
    beta_k: 3380.0,
};

#[cfg(test)]
mod tests {
    use super::*;

    use crate::circuit::vesc4_f405::{R001, R0005, R005};

    const GUIDE: &str = include_str!("../../README.md");

    const BOARDS: [Board; 4] = [BOARD, R0005, R001, R005];

    #[test]
    fn a_refusal_of_a_dead_time_names_the_least() {
        for least in BOARDS.map(|board| board.least_dead_time) {
            assert!(least.refusal.contains(&format!(" {} ns", least.ns)));
            // After the parameter's name in a text of 50 bytes.
            assert!("PWM_DEADTIME_NS: ".len() + least.refusal.len() <= 50);
        }
    }

    #[test]
    fn limits_are_within_what_the_converters_show_and_named() {
        for board in BOARDS {
            let shown_a = Board::greatest_phase(board.current_range_a).value;
            let limits = [
                (board.greatest_phase, shown_a, "A"),
                (
                    board.greatest_supply,
                    0.97 * 4095.0 * board.bus_v_per_count,
                    "V",
                ),
            ];
            for (greatest, shown, unit) in limits {
                assert!(greatest.value <= shown && greatest.value > 0.9 * shown);
                let number = format!(" {} {unit}", greatest.value);
                assert!(greatest.refusal.ends_with(&number));
            }
        }
        // The guide has the first one.
        assert!(GUIDE.contains(&format!("up to {} A peak", BOARD.greatest_phase.value)));
    }

    #[test]
    fn a_refusal_of_a_pwm_frequency_names_the_highest_and_its_cause() {
        for bound in BOARD.pwm_bounds {
            let (id, value) = bound.choice;
            let cause = match id {
                ParamId::CtlDrive if value == 0.0 => "field-oriented".to_owned(),
                ParamId::CtlDrive => "in six-step".to_owned(),
                _ => format!("with {} {value}", id.entry().name),
            };
            assert_eq!(bound.refusal, format!("at most {} {cause}", bound.hz));
            assert!("PWM_FREQ_HZ: ".len() + bound.refusal.len() <= 50);
            let row = format!("| `{}` {value}", id.entry().name);
            let mut rows = GUIDE.lines().filter(|line| line.starts_with(&row));
            assert!(
                rows.any(|row| row.ends_with(&format!("| {} |", bound.hz))),
                "{row}"
            );
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
