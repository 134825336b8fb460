//! Coefficients of the sensing, of the dead time and of the bridge's preparation.

use core::f32::consts::TAU;

use fixed::types::I1F31;

use super::{Board, BuildError, Si, gain, refuse};
use crate::control::modulator::Modulation;
use crate::control::sensing::{self, Shunts};
use crate::control::{catch, dead_time};
use crate::drive::Charge;
use crate::params::{ParamId, Params};
use crate::units::{AdcCounts, Duty, Scale, Speed};

/// For how long the offsets are measured, s; rounded to a power of two of periods. 5 ms leave a
/// tenth of one reading's noise.
const ZERO_S: f32 = 0.005;

/// Greatest offset of a sound sensor, of the converter's range: 1 % resistors about its middle and
/// an amplifier's 3 mV times 16 make up to 6 %.
const OFFSET_SHARE: f32 = 0.1;

/// The phase current from which its sign is certain; below, the dead time is compensated in
/// proportion.
const SIGN_CERTAIN_A: f32 = 0.3;

/// What one charging pulse may add to the current of a rotor at `CTL_RPM_MAX`, of `LIM_PHASE_A`:
/// the low sides short its back-EMF, and a few pulses may add up.
const CHARGE_CURRENT_SHARE: f32 = 0.125;

/// Drop of a low side's body diode at the milliamperes that the dividers draw, V.
const DIODE_V: f32 = 0.7;

/// Noise of a terminal's reading, counts rms, as `catch` reckons with.
const TERMINAL_NOISE_COUNTS: f32 = 2.0;

/// Mean of the highest of three readings that noise alone does not reach: 1.9 counts for 2 rms.
const TERMINAL_FLOOR_COUNTS: f32 = 4.5;

/// Speed below which a rotor need not be caught, of `STA_RUN_RPM`.
const STANDING_SHARE: f32 = 0.15;

/// Mean of the highest of three half-waves, of their amplitude: 3·√3/2π.
const HIGHEST_SHARE: f32 = 0.827;

/// Time constant of that mean, s: a resting rotor is known after one to two of them.
const LEVEL_S: f32 = 0.004;

/// Longest memory of the observation of a coasting rotor, s.
const MEMORY_S: f32 = 0.05;

/// For how long all must fit before a coasting rotor is known, s.
const SURE_S: f32 = 0.001;

/// For how long it may not fit before the observation begins anew, s.
const UNFIT_S: f32 = 0.004;

/// Greatest duty that lets every phase that must be read be read, and keeps the drivers of the high
/// sides supplied; and the greatest duty of a phase that is read.
pub(super) fn duty_max(
    p: &Si,
    board: &Board,
    modulation: Modulation,
) -> Result<(f32, f32), BuildError> {
    let with_low_side_on = |s: f32| 1.0 - (s + 2.0 * p.dead_time_s) / p.period_s;
    let window = with_low_side_on(board.low_side_on_s);
    let supplied = with_low_side_on(board.refresh_s);
    let read = match board.shunts {
        // One number for all phases: where c is the highest more would not lengthen the vector that
        // a and b allow a sixth of a turn later.
        Shunts::Two => window,
        // Only the highest phase may be left out, so the second must fit: with the longest vector
        // it comes to this share of the greatest duty, and the dead time's compensation on top.
        Shunts::Three => {
            let second = match modulation {
                Modulation::SpaceVector => 0.5 + libm::sqrtf(3.0) / 4.0,
                Modulation::Sine => 0.75,
            };
            (window - p.dead_time_s / p.period_s) / second
        }
    };
    let duty_max = read.min(supplied);
    if window.min(duty_max) < 0.5 {
        return refuse(
            ParamId::PwmFreqHz,
            "too high: the low sides could not be read",
        );
    }
    Ok((duty_max, window))
}

/// The currents' offsets and reconstruction.
pub(super) fn sensing(p: &Si, board: &Board, window: f32) -> sensing::Config {
    let readings = ZERO_S / p.period_s;
    sensing::Config {
        shunts: board.shunts,
        window: Duty::saturating_from_num(window),
        // 5 at 8 kHz to 8 at 60 kHz.
        zero_readings_log2: (libm::log2f(readings) + 0.5) as u32,
        offset_max: AdcCounts::saturating_from_num(
            OFFSET_SHARE * board.current_range_a / board.current_a_per_count,
        ),
    }
}

/// The observation of the terminals while the bridge is off.
pub(super) fn catch(
    params: &Params,
    p: &Si,
    scale: &Scale,
    board: &Board,
) -> Result<catch::Config, BuildError> {
    let counts_per_turn = p.flux_wb * TAU / (p.period_s * board.terminal_v_per_count);
    let standing: Speed = scale.speed_from_rpm(STANDING_SHARE * params.get(ParamId::StaRunRpm));
    let standing_counts = HIGHEST_SHARE * counts_per_turn * standing.to_num::<f32>();
    let share = |time_s: f32| (65536.0 * p.period_s / time_s) as u32;
    let periods = |time_s: f32| (time_s / p.period_s) as u32;
    Ok(catch::Config {
        emf: gain(ParamId::MotFluxMwb, counts_per_turn)?,
        diode: AdcCounts::saturating_from_num(DIODE_V / board.terminal_v_per_count),
        prior: (TERMINAL_NOISE_COUNTS * counts_per_turn / TAU) as u32,
        forget_min: share(MEMORY_S),
        standing: AdcCounts::saturating_from_num(standing_counts.max(TERMINAL_FLOOR_COUNTS)),
        level_share: share(LEVEL_S),
        sure_periods: periods(SURE_S),
        lost_periods: periods(UNFIT_S),
    })
}

/// The dead time's compensation.
pub(super) fn dead_time(p: &Si, scale: &Scale) -> Result<dead_time::Config, BuildError> {
    let duty = p.dead_time_s / p.period_s;
    Ok(dead_time::Config {
        slope: gain(
            ParamId::PwmDeadtimeNs,
            duty * scale.current_a / SIGN_CERTAIN_A,
        )?,
        duty: I1F31::saturating_from_num(duty),
    })
}

/// The low sides' pulses before a switch-on: as wide as the back-EMF of the fastest rotor allows,
/// but wide enough to be read and at most half a period, and as many as the board's time takes.
pub(super) fn charge(params: &Params, p: &Si, board: &Board) -> Charge {
    let rad_s = params.get(ParamId::CtlRpmMax) * p.pole_pairs * TAU / 60.0;
    let rise_a_s = rad_s * p.flux_wb / p.inductance_h;
    let allowed_s = CHARGE_CURRENT_SHARE * params.get(ParamId::LimPhaseA) / rise_a_s;
    let pulse_s = allowed_s.max(board.low_side_on_s).min(0.5 * p.period_s);
    Charge {
        duty: Duty::saturating_from_num(pulse_s / p.period_s),
        periods: libm::ceilf(board.charge_s / pulse_s) as u32,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::modulator::{Supply, duties};
    use crate::control::transform::AlphaBeta;
    use crate::drive::Config;
    use crate::params::build;
    use crate::units::Voltage;
    use fixed::types::I5F27;

    /// A board on which the windows decide, not the drivers' supply.
    const SLOW_AMPLIFIERS: Board = Board {
        low_side_on_s: 4e-6,
        refresh_s: 0.5e-6,
        ..Board::BENCH
    };

    fn config(board: &Board, modulation: f32) -> Config {
        let mut params = Params::default();
        params
            .set(ParamId::CtlModulation, modulation)
            .expect("in range");
        build(&params, board).expect("it fits")
    }

    /// Greatest duty of the highest and of the second phase, over a turn of the longest vector
    /// with the whole compensation for its signs.
    fn highest_and_second(config: &Config) -> (f32, f32) {
        let supply = Supply::new(&config.modulator, Voltage::ONE);
        let length = supply.vector_max.to_num::<f32>();
        let mut greatest = (0.0_f32, 0.0_f32);
        for degrees in 0..360 {
            let (sin, cos) = libm::sincosf(degrees as f32 * TAU / 360.0);
            let v = AlphaBeta {
                alpha: I5F27::from_num(length * cos),
                beta: I5F27::from_num(length * sin),
            };
            let whole = config.dead_time.duty;
            for signs in 0..8 {
                let extra = [0, 1, 2].map(|bit| if signs >> bit & 1 == 0 { whole } else { -whole });
                let mut made =
                    duties(&config.modulator, &supply, v, extra).map(|d| d.to_num::<f32>());
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
