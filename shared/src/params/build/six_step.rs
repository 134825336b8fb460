//! The six-step drive's coefficients: of the board, the limits and the start, not of the motor.

use core::f32::consts::TAU;

use fixed::types::{I1F31, I36F28};

use super::outer;
use super::si::{Si, TEST_SHARE};
use crate::control::delay::Delay;
use crate::control::six_step::{crossing, duty};
use crate::drive::config::six_step::Config;
use crate::math::Real;
use crate::params::ParamId;

/// Back-EMF on the floating terminal that is taken for one, V, and the same in counts: noise and
/// the difference between the switches that are on.
const LEAST_V: f32 = 0.02;
const LEAST_COUNTS: f32 = 1.5;

/// Counts at which the terminals' converter is near its end.
const GREATEST_COUNTS: f32 = 0.97 * 4096.0;

/// Least periods a sextant at `CTL_RPM_MAX`.
const LEAST_PERIODS: f32 = 4.0;

/// Duty over an error of `CTL_RPM_MAX`.
const PROPORTIONAL: f32 = 1.0;

/// k_i over k_p, of the bandwidth that the speed loop is to have: with 7.9 Hz 20 1/s, where the
/// bench's shaft has a time constant of 46 ms under a constant duty.
const CORNER_SHARE: f32 = 0.4;

/// Rate of the duty while the current has all of `LIM_PHASE_A`, or of [`BOUND_LEAST_A`], left, 1/s.
const BOUND_RATE: f32 = 320.0;

/// The least bound, A, that the loop's gain grows for: a lower one makes a motor's current answer no
/// slower. On the bench, at 5 A the loop would ring by half of it.
const BOUND_LEAST_A: f32 = 20.0;

/// Time for which a start waits for a crossing, s: under its ramp's current a rotor with ten times the
/// bench's inertia takes 0.08 s.
const PATIENCE_S: f32 = 0.2;

/// Time for which a start may go on without a turn of crossings in a row, s.
const ASTRAY_S: f32 = 0.9;

/// Greatest current against the rotation, of `LIM_PHASE_A`.
const BRAKING_SHARE: f32 = 0.25;

pub(super) fn six_step(p: &Si, duty_max: f32) -> Config {
    let get = |id| p.get(id);
    let fastest = get(ParamId::CtlRpmMax) * p.pole_pairs * p.period_s / 60.0;
    p.refuse_if(
        6.0 * fastest * LEAST_PERIODS > 1.0,
        ParamId::PwmFreqHz,
        "less than four periods a sextant at CTL_RPM_MAX",
    );
    let limit_a = get(ParamId::LimPhaseA);
    let start_a = p.from_motor.ramp_a.min(limit_a);
    let count_v = p.board.terminal_v_per_count;
    let k_p = PROPORTIONAL / fastest;
    let corner = CORNER_SHARE * TAU * p.from_motor.speed_hz;
    let bound = BOUND_RATE * p.period_s * p.scale.current_a / limit_a.max(BOUND_LEAST_A);
    let step = p.from_motor.ramp_rpm_s * p.period_s * p.pole_pairs * p.period_s / 60.0;
    Config {
        planner: outer::planner(p, p.period_s),
        terminal: p.gain(ParamId::LimBusVMax, count_v / p.scale.voltage_v),
        crossing: crossing::Config {
            least: p.voltage(LEAST_V.max(LEAST_COUNTS * count_v)),
            greatest: p.voltage(GREATEST_COUNTS * count_v),
            delayed: match p.board.delay {
                Delay::None | Delay::Half => 0,
                Delay::One => 1,
            },
        },
        duty: duty::Config {
            k_p: p.gain(ParamId::CtlRpmMax, k_p),
            k_i: p.gain(ParamId::CtlBwSpdHz, k_p * corner * p.period_s),
            k_b: p.gain(ParamId::LimPhaseA, bound),
            duty_max: I1F31::from_f32(duty_max),
        },
        delay: p.board.delay,
        braking: p.scale.current_from_a(BRAKING_SHARE * limit_a),
        start_current: p.scale.current_from_a(start_a),
        test_current: p.scale.current_from_a(TEST_SHARE * limit_a),
        park_charge: I36F28::from_f32(p.from_motor.park_as / (p.scale.current_a * p.period_s)),
        ramp: p.gain(
            ParamId::StaRampRpmS,
            step * p.scale.current_a / p.from_motor.ramp_a,
        ),
        patience: (PATIENCE_S / p.period_s) as u16,
        astray: (ASTRAY_S / p.period_s) as u16,
        run_speed: p.scale.speed_from_rpm(p.from_motor.run_rpm),
        slow: p.slow(),
    }
}
