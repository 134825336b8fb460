//! Coefficients of the start.

use core::f32::consts::TAU;

use siskin_params::ParamId;
use siskin_params::choice::StaMode;
use siskin_units::math::{Real, square_root};
use siskin_units::{Charge, INVERSE_FLUX_NOMINAL, Voltage};

use super::si::Si;
use crate::control::start;
use crate::drive::ATTEMPTS;

/// Damping ζ of the rotor's swing about the current vector in Park and Ramp.
const SWING_DAMPING: f32 = 0.5;

/// Rate at which the frame yields over the swing's ω_n: fast for the swing, slow for noise.
const YIELD_RATE_SHARE: f32 = 5.0;

/// Greatest rate per period: all that is missing in the two periods until the next look.
const YIELD_RATE_MAX: f32 = 0.5;

/// Share of its current's torque that the ramp uses; the rest is for the load and a swinging rotor.
const TORQUE_SHARE: f32 = 0.3;

/// The course of an attempt: current over `STA_RAMP_A`; the inertia that it assumes over the stated one; how much shorter
/// Park and steeper Ramp are than stated, where the rotor follows; and the least length of Park in periods of the rotor's
/// swing. The first half of Park sweeps, and in the second a swing damped by ζ = 0.5 decays: of three periods to 3 %, of
/// two to 10 %.
type Course = [f32; 4];

/// The quick attempt, then those of a start, with half more current each time.
const COURSES: [Course; 1 + ATTEMPTS] = [
    [4.0, 1.0, 6.0, 3.0],
    [1.0, 1.0, 1.0, 3.0],
    [1.5, 10.0, 1.0, 3.0],
    [2.25, 20.0, 1.0, 3.0],
    [3.375, 40.0, 1.0, 3.0],
];

/// The first attempt of a start, unless `STA_MODE` has it as stated: in the time that the torque of most of the limit takes.
const AT_ONCE: Course = [4.0, 1.0, 12.0, 2.0];

/// Time for which a rotor may turn too slowly in Ramp, in periods of its swing.
const ASTRAY_SWINGS: f32 = 1.0;

/// Supply over the voltage of its longest vector: 1.75 to 2.2, by modulation and largest duty.
const SUPPLY: f32 = 2.0;

/// Fills in the attempts of a start (section 3.2 of the second paper): each has more current than the one before, up to
/// `LIM_PHASE_A`, and is slower; but the first may be [`AT_ONCE`].
pub(super) fn attempts(p: &Si, places: &mut [start::Config; 1 + ATTEMPTS]) {
    for (place, course) in places.iter_mut().zip(&COURSES) {
        attempt(p, course, place);
    }
    if p.chosen(StaMode::AtOnce) {
        attempt(p, &AT_ONCE, &mut places[1]);
    }
}

/// Returns the supply that an open-loop start may use: [`SUPPLY`] times the voltage (R + ω_cl·L)·`LIM_PHASE_A` plus the
/// back-EMF at ω_cl. In two phases of a rotor that stands, R·`LIM_PHASE_A` alone makes √3/2 of the limit.
pub(super) fn bus(p: &Si) -> Voltage {
    let rad_s = TAU / 60.0 * p.settings.run_rpm * p.pole_pairs;
    let volts = (p.r + rad_s * p.l) * p.limit_a + rad_s * p.flux;
    p.voltage(volts * SUPPLY)
}

fn attempt(p: &Si, [current, inertia, haste, swings]: &Course, place: &mut start::Config) {
    let settings = &p.settings;
    let current_a = (current * settings.ramp_a).min(p.limit_a);
    let inertia = inertia * p.j;
    let torque_nm = 1.5 * p.pole_pairs * p.flux * current_a;
    // Greatest acceleration from the current, in electrical rad/s²: p·1.5·p·φ·I/J.
    let possible_rad_s2 = TORQUE_SHARE * p.pole_pairs * torque_nm / inertia;
    let stated_rad_s2 = haste * settings.ramp_rpm_s * p.pole_pairs * TAU / 60.0;
    let ramp_rad_s2 = stated_rad_s2.min(possible_rad_s2);
    // About the current vector the rotor is a pendulum of ω_n² = 1.5·p²·φ·I/J; yielding by 2ζ/ω_n per unit of speed
    // damps it by ζ.
    let swing_rad_s = square_root(p.pole_pairs * torque_nm / inertia);
    let yield_rate = (YIELD_RATE_SHARE * swing_rad_s * p.t).min(YIELD_RATE_MAX);
    let swing_as = swings * TAU / swing_rad_s * current_a;
    let park_charge = (settings.park_as / haste).max(swing_as) / p.unit_as;
    place.current = p.scale.current_from_a(current_a);
    place.yielding = p.gain(ParamId::MotJGcm2, 2.0 * SWING_DAMPING / swing_rad_s / p.t);
    place.yield_rate = p.gain(ParamId::MotJGcm2, yield_rate);
    place.park_charge = Charge::from_f32(park_charge);
    // A third of a turn, from one phase's axis to the next, in the first half.
    place.sweep = p.gain(ParamId::StaParkAs, 1.0 / 3.0 / (0.5 * park_charge));
    place.k_s = p.gain(
        ParamId::StaRampRpmS,
        ramp_rad_s2 / TAU * p.t * p.t * p.unit_a / current_a,
    );
    place.astray_periods = (ASTRAY_SWINGS * TAU / (swing_rad_s * p.t)) as u32;
    place.resistance = p.gain(ParamId::MotRMohm, p.r * p.voltage_per_current);
    place.reactance = p.gain(ParamId::MotLUh, p.l * p.voltage_per_current * TAU / p.t);
    place.run_speed = p.scale.speed_from_rpm(settings.run_rpm);
    place.xi_nominal = INVERSE_FLUX_NOMINAL;
}

#[cfg(test)]
mod tests {
    use siskin_params::{BOSSO_BENCH, Board, ParamId, Params};

    use super::*;
    use crate::build::build;
    use crate::build::tests::over;
    use core::f32::consts::TAU;

    fn config(changes: &[(ParamId, f32)]) -> crate::drive::Config {
        build(&over(Params::of(&BOSSO_BENCH), changes), &Board::BENCH).expect("it makes a drive")
    }

    /// Returns amperes, rpm/s and seconds of Park for each attempt.
    fn courses(changes: &[(ParamId, f32)]) -> std::vec::Vec<[f32; 3]> {
        let config = config(changes);
        let scale = config.scale;
        let course = |attempt: &start::Config| {
            let mut state = start::State::default();
            let mut periods = 0;
            while !start::aligned(attempt, &state) {
                start::park(attempt, &mut state, attempt.current, 1);
                periods += 1;
            }
            // Over 1000 periods, so that rounding does not matter.
            start::ramp(attempt, &mut state, attempt.current);
            for _ in 0..1000 {
                start::advance(&mut state);
            }
            [
                scale.amperes(attempt.current),
                scale.rpm(state.omega_s) / (1000.0 * scale.period_s),
                periods as f32 * scale.period_s,
            ]
        };
        config.start.iter().map(course).collect()
    }

    /// Returns the greatest electrical acceleration from a current, rad/s²: p·1.5·p·φ·I/J.
    fn possible(current_a: f32, inertia: f32) -> f32 {
        12.0 * 1.5 * 12.0 * 1.3e-3 * current_a / (inertia * 1.43e-4)
    }

    #[test]
    fn each_attempt_has_half_more_current_and_time_for_a_greater_inertia() {
        let courses = courses(&[]);
        let inertia = [1.0, 10.0, 20.0, 40.0];
        let current = [4.0, 6.0, 9.0, 13.5];
        for (n, [amperes, rpm_s, park_s]) in courses.into_iter().skip(1).enumerate() {
            assert!((amperes - current[n]).abs() < 1e-3, "{n}: {amperes}");
            // The stated 800 rpm/s, or three tenths of what the current can do.
            let most = possible(current[n], inertia[n]);
            let wanted = (0.3 * most / 12.0 * 60.0 / TAU).min(800.0);
            assert!(
                (rpm_s / wanted - 1.0).abs() < 0.01,
                "{n}: {rpm_s} of {wanted}"
            );
            let swing_s = TAU / square_root(most);
            assert!(
                (park_s / (3.0 * swing_s) - 1.0).abs() < 0.01,
                "{n}: {park_s}"
            );
        }
    }

    #[test]
    fn the_quick_attempt_has_four_times_the_current_and_six_times_the_ramp() {
        let [quick, ..] = courses(&[])[..] else {
            panic!("no attempts")
        };
        let swing_s = TAU / square_root(possible(16.0, 1.0));
        for (got, wanted) in quick.into_iter().zip([16.0, 4800.0, 3.0 * swing_s]) {
            assert!((got / wanted - 1.0).abs() < 0.01, "{quick:?}");
        }
    }

    #[test]
    fn a_start_at_once_takes_the_time_of_most_of_the_limit_s_torque_and_then_goes_on_as_stated() {
        let stated = courses(&[]);
        let at_once = courses(&[StaMode::AtOnce.setting()]);
        let most = possible(16.0, 1.0);
        let wanted = [
            16.0,
            (0.3 * most / 12.0 * 60.0 / TAU).min(9600.0),
            2.0 * TAU / square_root(most),
        ];
        for (got, wanted) in at_once[1].into_iter().zip(wanted) {
            assert!((got / wanted - 1.0).abs() < 0.01, "{at_once:?}: {wanted}");
        }
        assert_eq!((&at_once[0], &at_once[2..]), (&stated[0], &stated[2..]));
    }

    #[test]
    fn no_attempt_has_more_than_the_bound_of_the_phase_current() {
        let courses = courses(&[(ParamId::LimPhaseA, 7.0)]);
        let currents: std::vec::Vec<f32> = courses.iter().map(|course| course[0]).collect();
        for (got, wanted) in currents.iter().zip([7.0, 4.0, 6.0, 7.0, 7.0]) {
            assert!((got - wanted).abs() < 1e-3, "{currents:?}");
        }
    }

    #[test]
    fn park_is_as_long_as_is_stated_where_the_swing_is_shorter() {
        let courses = courses(&[(ParamId::MotJGcm2, 10.0), (ParamId::StaParkAs, 2.0)]);
        // The quick attempt takes a sixth of the charge, with four times the current.
        assert!((courses[0][2] - 0.0208).abs() < 1e-3, "{courses:?}");
        assert!((courses[1][2] - 0.5).abs() < 1e-3, "{courses:?}");
    }
}
