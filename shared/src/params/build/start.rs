//! The coefficients of the start.

use core::f32::consts::TAU;

use fixed::types::I36F28;

use super::si::Si;
use crate::control::start;
use crate::drive::ATTEMPTS;
use crate::math::{Real, square_root};
use crate::params::ParamId;
use crate::units::INVERSE_FLUX_NOMINAL;

/// Damping ζ of the rotor's swing about the current's vector in Park and Ramp.
const SWING_DAMPING: f32 = 0.5;

/// Rate at which the frame yields, over the swing's ω_n: fast against it, slow against noise.
const YIELD_RATE_SHARE: f32 = 5.0;

/// Greatest rate a period: all that is missing in the two periods until the next look.
const YIELD_RATE_MAX: f32 = 0.5;

/// Share of the torque of its current that the ramp uses: the rest is for the load and for a rotor that
/// swings.
const TORQUE_SHARE: f32 = 0.3;

/// Current of an attempt over that of the one before.
const CURRENT_GROWTH: f32 = 1.5;

/// Inertia that each attempt assumes, over the stated one.
const INERTIA: [f32; ATTEMPTS] = [1.0, 10.0, 20.0, 40.0];

/// Least length of Park in periods of the rotor's swing: half of it sweeps, and in the other half a
/// swing that is damped by ζ = 0.5 dies down to 3 %.
const PARK_SWINGS: f32 = 3.0;

/// Time for which a rotor may turn too slowly in Ramp, in periods of its swing.
const ASTRAY_SWINGS: f32 = 1.0;

/// Puts the attempts of a start (section 3.2 of the second paper) into their places: each with more
/// current, up to `LIM_PHASE_A`, and slower than the one before.
pub(super) fn attempts(p: &Si, places: &mut [start::Config; ATTEMPTS]) {
    let mut current_a = p.from_motor.ramp_a;
    for (place, inertia) in places.iter_mut().zip(INERTIA) {
        let bounded_a = current_a.min(p.get(ParamId::LimPhaseA));
        *place = attempt(p, bounded_a, inertia * p.inertia_kgm2);
        current_a *= CURRENT_GROWTH;
    }
}

fn attempt(p: &Si, current_a: f32, inertia_kgm2: f32) -> start::Config {
    // What the current can accelerate, in electrical rad/s²: p·1.5·p·φ·I/J.
    let torque_nm = 1.5 * p.pole_pairs * p.flux_wb * current_a;
    let possible = TORQUE_SHARE * p.pole_pairs * torque_nm / inertia_kgm2;
    let asked = p.from_motor.ramp_rpm_s * p.pole_pairs * TAU / 60.0;
    let acceleration = asked.min(possible);
    let step = acceleration / TAU * p.period_s * p.period_s;
    // The rotor about the current's vector is a pendulum of ω_n² = 1.5·p²·φ·I/J; yielding by
    // 2ζ/ω_n a unit of speed damps it by ζ.
    let swing_rad_s = square_root(p.pole_pairs * torque_nm / inertia_kgm2);
    let yielding_s = 2.0 * SWING_DAMPING / swing_rad_s;
    let swing_as = PARK_SWINGS * TAU / swing_rad_s * current_a;
    let park_as = p.from_motor.park_as.max(swing_as);
    let park_charge = park_as / (p.scale.current_a * p.period_s);
    let voltage_per_current = p.scale.current_a / p.scale.voltage_v;
    start::Config {
        current: p.scale.current_from_a(current_a),
        yielding: p.gain(ParamId::MotJGcm2, yielding_s / p.period_s),
        yield_rate: p.gain(
            ParamId::MotJGcm2,
            (YIELD_RATE_SHARE * swing_rad_s * p.period_s).min(YIELD_RATE_MAX),
        ),
        park_charge: I36F28::from_f32(park_charge),
        // A third of a turn, from one phase's axis to the next one's, in the first half.
        sweep: p.gain(ParamId::StaParkAs, 1.0 / 3.0 / (0.5 * park_charge)),
        k_s: p.gain(ParamId::StaRampRpmS, step * p.scale.current_a / current_a),
        astray_periods: (ASTRAY_SWINGS * TAU / (swing_rad_s * p.period_s)) as u32,
        resistance: p.gain(ParamId::MotRMohm, p.resistance_ohm * voltage_per_current),
        reactance: p.gain(
            ParamId::MotLUh,
            p.inductance_h * voltage_per_current * TAU / p.period_s,
        ),
        run_speed: p.scale.speed_from_rpm(p.from_motor.run_rpm),
        xi_nominal: INVERSE_FLUX_NOMINAL,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::{BOSSO_BENCH, Board, Params, build};

    fn config(changes: &[(ParamId, f32)]) -> crate::drive::Config {
        let mut params = Params::of(&BOSSO_BENCH);
        for (id, value) in changes {
            params.set(*id, *value).expect("in range");
        }
        build(&params, &Board::BENCH).expect("it makes a drive")
    }

    /// Amperes, rpm/s and seconds of Park, of each attempt.
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

    /// rad/s² of the electrical angle that a current makes at most: p·1.5·p·φ·I/J.
    fn possible(current_a: f32, inertia: f32) -> f32 {
        12.0 * 1.5 * 12.0 * 1.3e-3 * current_a / (inertia * 1.43e-4)
    }

    #[test]
    fn each_attempt_has_half_more_current_and_time_for_a_greater_inertia() {
        let courses = courses(&[]);
        let inertia = [1.0, 10.0, 20.0, 40.0];
        let current = [4.0, 6.0, 9.0, 13.5];
        for (n, [amperes, rpm_s, park_s]) in courses.into_iter().enumerate() {
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
    fn no_attempt_has_more_than_the_bound_of_the_phase_current() {
        let courses = courses(&[(ParamId::LimPhaseA, 7.0)]);
        let currents: std::vec::Vec<f32> = courses.iter().map(|course| course[0]).collect();
        for (got, wanted) in currents.iter().zip([4.0, 6.0, 7.0, 7.0]) {
            assert!((got - wanted).abs() < 1e-3, "{currents:?}");
        }
    }

    #[test]
    fn park_is_as_long_as_is_stated_where_the_swing_is_shorter() {
        let courses = courses(&[(ParamId::MotJGcm2, 10.0), (ParamId::StaParkAs, 2.0)]);
        assert!((courses[0][2] - 0.5).abs() < 1e-3, "{courses:?}");
    }
}
