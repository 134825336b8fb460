//! Coefficients of the sensing, the dead time and the bridge's charging.

use core::f32::consts::{SQRT_2, TAU};

use siskin_params::{Board, ParamId, Shunts};
use siskin_units::math::{Real, SQRT_3};
use siskin_units::{AdcCounts, Duty};

use super::si::Si;
use crate::control::modulator::Modulation;
use crate::control::sensing;
use crate::control::{catch, dead_time};
use crate::drive::Charge;

/// Time over which the offsets are measured, s, rounded to a power of two of periods. 5 ms leave a tenth of one
/// reading's noise.
const ZERO_S: f32 = 0.005;

/// Greatest offset of a sound sensor over the converter's range: 1 % resistors and an amplifier's 3 mV times 16 make up
/// to 8 %.
const OFFSET_SHARE: f32 = 0.1;

/// The phase current above which its sign is certain, over the change that the highest supply makes in a dead time;
/// below, the dead time is compensated in proportion. 0.3 A on the bench.
const SIGN_CERTAIN_SHARE: f32 = 0.6;

/// Time for which a turning rotor may go unobserved, s: by then a propeller at full speed has fallen 2° behind, against
/// tens of degrees after a long charge. Switching keeps the drivers supplied.
const UNSEEN_S: f32 = 0.002;

/// Most that one charging pulse may add to the current of a rotor at `CTL_RPM_MAX`, over `LIM_PHASE_A`: the low sides
/// short its back-EMF, and a few pulses may add up.
const CHARGE_CURRENT_SHARE: f32 = 0.125;

/// Drop of a low side's body diode at the milliamperes that the dividers draw, V.
const DIODE_V: f32 = 0.7;

/// Noise of the mean of four terminal readings that `catch` assumes, counts rms.
const TERMINAL_NOISE_COUNTS: f32 = 1.0;

/// Mean of the highest of three readings that noise alone does not reach: it makes 1.9 counts at 2 rms.
const TERMINAL_FLOOR_COUNTS: f32 = 4.5;

/// Speed over `STA_RUN_RPM` below which a rotor need not be caught.
const STANDING_SHARE: f32 = 0.15;

/// Mean of the highest of three half-waves over their amplitude: 3·√3/2π.
const HIGHEST_SHARE: f32 = 0.827;

/// Time constant of that mean, s: a resting rotor is recognised after one to two of them.
const LEVEL_S: f32 = 0.004;

/// Longest memory of the observation of a coasting rotor, s.
const MEMORY_S: f32 = 0.05;

/// Time for which everything must fit before a coasting rotor counts as known, s.
const SURE_S: f32 = 0.001;

/// Time for which it may fail to fit before the observation restarts, s.
const UNFIT_S: f32 = 0.004;

/// Greatest mean error of the current sum of sound sensors over the converter's range: half of a zero's greatest
/// offset. The zeros are measured before the start and drift by less.
const UNBALANCE_SHARE: f32 = 0.5 * OFFSET_SHARE;

/// Returns the greatest duty at which every phase that must be read can be, and the high sides' drivers stay supplied;
/// and the greatest duty of a phase that is read.
pub(super) fn duty_max(p: &Si, modulation: Modulation) -> (f32, f32) {
    let with_low_side_on = |s: f32| 1.0 - (s + 2.0 * p.dead_time_s) / p.t;
    let window = with_low_side_on(p.board.low_side_on_s);
    let supplied = with_low_side_on(p.board.refresh_s);
    let read = match p.board.shunts {
        // One limit for all phases: more where c is highest would not lengthen the vector that a and b allow a sixth of
        // a turn later.
        Shunts::Two => window,
        // Only the highest phase may go unread, so the second must fit: with the longest vector it reaches this share
        // of the greatest duty, plus the dead-time compensation.
        Shunts::Three => {
            let second = match modulation {
                Modulation::SpaceVector => 0.5 + SQRT_3 / 4.0,
                Modulation::Sine(_) => 0.75,
            };
            (window - p.dead_share) / second
        }
    };
    let duty_max = read.min(supplied);
    p.refuse_above(
        0.5,
        window.min(duty_max),
        ParamId::PwmFreqHz,
        "too high: the low sides could not be read",
    );
    (duty_max, window)
}

/// Sets up the currents' offsets and reconstruction.
pub(super) fn sensing(p: &Si, window: f32, place: &mut sensing::Config) {
    // Nearest power of two on a log scale: √2 times as many, rounded down.
    let readings = p.periods(SQRT_2 * ZERO_S);
    place.shunts = p.board.shunts;
    place.window = Duty::from_f32(window);
    // 5 at 8 kHz to 8 at 60 kHz.
    place.zero_readings_log2 = readings.checked_ilog2().unwrap_or(0);
    let board = p.board;
    place.offset_max =
        AdcCounts::from_f32(OFFSET_SHARE * board.current_range_a / board.current_a_per_count);
}

/// Returns the greatest mean error of the current sum.
pub(crate) fn unbalance_max(board: &Board) -> AdcCounts {
    AdcCounts::from_f32(UNBALANCE_SHARE * board.current_range_a / board.current_a_per_count)
}

/// Sets up the observation of the terminals while the bridge is off.
pub(super) fn catch(p: &Si, place: &mut catch::Config) {
    let standing = p
        .scale
        .speed_from_rpm(STANDING_SHARE * p.settings.run_rpm)
        .to_f32();
    let v_per_count = p.board.terminal_v_per_count;
    let look_s = catch::LOOK_PERIODS as f32 * p.t;
    let counts_per_turn = p.flux * TAU / (p.t * v_per_count);
    let per_look = p.t / look_s;
    place.emf = (256.0 * counts_per_turn) as u32;
    place.diode = Real::from_f32(DIODE_V / v_per_count);
    place.prior = (TERMINAL_NOISE_COUNTS * counts_per_turn * per_look / TAU) as u32;
    place.forget_min = Real::from_f32(look_s / MEMORY_S);
    place.standing =
        Real::from_f32((HIGHEST_SHARE * counts_per_turn * standing).max(TERMINAL_FLOOR_COUNTS));
    place.level_share = Real::from_f32(look_s / LEVEL_S);
    place.sure_looks = (SURE_S / look_s) as u32;
    place.lost_looks = (UNFIT_S / look_s) as u32;
}

/// Sets up the dead-time compensation.
pub(super) fn dead_time(p: &Si, place: &mut dead_time::Config) {
    // At least one count of the converter: there may be no dead time.
    let certain_a = (SIGN_CERTAIN_SHARE * p.supply_max_v * p.dead_time_s / p.l)
        .max(p.board.current_a_per_count);
    place.certainty = p.gain(ParamId::PwmDeadtimeNs, p.unit_a / certain_a);
    place.duty = Real::from_f32(p.dead_share);
    place.share = Real::from_f32(p.dead_time_s / p.t);
}

/// Returns the low sides' pulses before a switch-on: as wide as the back-EMF of the fastest rotor allows, but wide
/// enough to be read and at most half a period, and as many as the board's charging time takes.
pub(super) fn charge(p: &Si) -> Charge {
    let rise_a_s = p.fastest_rad_s * p.flux / p.l;
    let allowed_s = CHARGE_CURRENT_SHARE * p.limit_a / rise_a_s;
    let pulse_s = allowed_s.max(p.board.low_side_on_s).min(0.5 * p.t);
    let periods = (p.board.charge_s / pulse_s) as u32 + 1;
    Charge {
        duty: Duty::from_f32(pulse_s / p.t),
        periods,
        spared_periods: periods.saturating_sub(p.periods(UNSEEN_S)),
    }
}

#[cfg(test)]
mod tests {
    use core::f32::consts::TAU;

    use siskin_params::{BOSSO_BENCH, Params};
    use siskin_units::{TurnedVoltage, Voltage};

    use super::*;
    use crate::build::build;
    use crate::control::modulator::{Phases, Supply};
    use crate::control::overmodulation::duties;
    use crate::control::transform::{AlphaBeta, PhaseOrder};
    use crate::drive::Config;
    use fixed::types::I8F24;

    #[test]
    fn the_drivers_are_charged_for_their_time_and_a_turning_rotor_is_not_lost() {
        let board = Board {
            charge_s: 1e-3,
            ..Board::BENCH
        };
        let params = Params::of(&BOSSO_BENCH);
        let config = build(&params, &board).expect("it makes a drive");
        let period_s = config.scale.period_s;
        let charged = |periods: u32| periods as f32 * config.charge.duty.to_num::<f32>() * period_s;
        let all = config.charge.periods;
        assert!((1e-3..1.02e-3).contains(&charged(all)), "{}", charged(all));
        let turning_s = (all - config.charge.spared_periods) as f32 * period_s;
        assert!((1.9e-3..=2.0e-3).contains(&turning_s), "{turning_s}");
        // A short charge is done in full.
        let config = build(&params, &Board::BENCH).expect("it makes a drive");
        assert_eq!(
            (config.charge.periods, config.charge.spared_periods),
            (9, 0)
        );
    }

    /// A board limited by its sampling windows, not by the drivers' supply.
    const SLOW_AMPLIFIERS: Board = Board {
        low_side_on_s: 4e-6,
        refresh_s: 0.5e-6,
        ..Board::BENCH
    };

    fn config(board: &Board, modulation: f32) -> Config {
        let mut params = Params::of(&BOSSO_BENCH);
        params
            .set(ParamId::CtlModulation, modulation)
            .expect("in range");
        build(&params, board).expect("it fits")
    }

    /// Returns the greatest duty of the highest and of the second phase, over a turn of the longest vector with the
    /// full compensation for its signs.
    fn highest_and_second(config: &Config) -> (f32, f32) {
        let supply = Supply::new(&config.modulator, Voltage::ONE, Voltage::ZERO);
        let length = supply.longest.length().to_num::<f32>();
        let mut greatest = (0.0_f32, 0.0_f32);
        for degrees in 0..360 {
            let (sin, cos) = libm::sincosf(degrees as f32 * TAU / 360.0);
            let v = AlphaBeta {
                alpha: TurnedVoltage::from_num(length * cos),
                beta: TurnedVoltage::from_num(length * sin),
            };
            for sixth in 0..6 {
                // A current with the six sign patterns of three phases.
                let (sin, cos) = libm::sincosf(sixth as f32 * TAU / 6.0);
                let certainty = AlphaBeta {
                    alpha: I8F24::from_num(20.0 * cos),
                    beta: I8F24::from_num(20.0 * sin),
                };
                let (order, dead_time) = (PhaseOrder::NORMAL, &config.dead_time);
                let phases = Phases::new(&supply, v, order, dead_time, certainty);
                let made = duties(&config.modulator, &phases);
                let mut made = made.map(|d| d.to_num::<f32>());
                made.sort_by(f32::total_cmp);
                greatest = (greatest.0.max(made[2]), greatest.1.max(made[1]));
            }
        }
        greatest
    }

    #[test]
    fn with_three_shunts_only_the_highest_phase_may_be_left_out() {
        for modulation in [0.0, 1.0] {
            let config = config(&SLOW_AMPLIFIERS, modulation);
            let (highest, second) = highest_and_second(&config);
            let window = config.sensing.window.to_num::<f32>();
            assert!(highest > window + 0.03, "{highest} of {window}");
            assert!(second < window + 1e-4, "{second} of {window}");
        }
    }

    #[test]
    fn with_two_shunts_no_phase_may_be_left_out() {
        let board = Board {
            shunts: Shunts::Two,
            ..SLOW_AMPLIFIERS
        };
        let config = config(&board, 0.0);
        let (highest, _) = highest_and_second(&config);
        let window = config.sensing.window.to_num::<f32>();
        assert!(highest <= window + 1e-4, "{highest} of {window}");
    }

    #[test]
    fn the_high_sides_drivers_stay_supplied() {
        let board = Board {
            refresh_s: 4e-6,
            ..Board::BENCH
        };
        let (highest, _) = highest_and_second(&config(&board, 0.0));
        // 41.7 µs less 4 µs and two dead times.
        assert!(highest <= 0.8801, "{highest}");
    }

    #[test]
    fn the_charge_takes_its_time_in_pulses_that_the_current_bears() {
        let config = config(&Board::BENCH, 0.0);
        let pulse_s = config.charge.duty.to_num::<f32>() * config.scale.period_s;
        let total_s = pulse_s * config.charge.periods as f32;
        assert!((63e-6..63e-6 + pulse_s).contains(&total_s), "{total_s}");
        // 9.8 V of back-EMF on 30.6 µH.
        assert!(pulse_s * 9.8 / 30.6e-6 < 2.6, "{pulse_s}");
    }
}
