//! Coefficients of the six-step drive: from the board, the limits and the start, not from the motor.

use core::f32::consts::TAU;

use fixed::types::I1F31;
use siskin_params::{Delay, ParamId, Shunts};
use siskin_units::Speed;
use siskin_units::math::Real;

use super::outer;
use super::si::{OVERMODULATION_HZ, Si, TEST_SHARE, TOO_FEW_PERIODS};
use crate::control::six_step::duty::WHOLE;
use crate::drive::config::six_step::Config;

/// Least voltage on the floating terminal that counts as back-EMF, V, and the same in counts: above noise and the
/// difference between the conducting switches.
const LEAST_V: f32 = 0.02;
const LEAST_COUNTS: f32 = 1.5;

/// Counts at which the terminals' converter is near full scale.
const GREATEST_COUNTS: f32 = 0.97 * 4096.0;

/// Least periods per sextant at `CTL_RPM_MAX`.
const LEAST_PERIODS: f32 = 4.0;

/// Duty per error of `CTL_RPM_MAX`.
const PROPORTIONAL: f32 = 1.0;

/// k_i over k_p as a share of the speed loop's bandwidth: 20 1/s at 7.9 Hz, where the bench's shaft has a time constant
/// of 46 ms under constant duty.
const CORNER_SHARE: f32 = 0.4;

/// Rate of the duty while the whole of `LIM_PHASE_A`, or of [`BOUND_LEAST_A`], is left, 1/s.
const BOUND_RATE: f32 = 320.0;

/// Limits below this, A, do not raise that rate further: a smaller limit makes no motor's current respond more slowly. On
/// the bench at 5 A the loop would ring by half of it.
const BOUND_LEAST_A: f32 = 20.0;

/// Greatest lead towards zero current, over `LIM_PHASE_A`: what a commutation takes is a share of the current, which the
/// limit bounds. Without it the currents of 500 random motors overshoot by up to 39 %, with it by 18 %
/// (`tests/python/out_of_the_bag.py`).
const LEAD_SHARE: f32 = 0.25;

/// Time for which a start waits for back-EMF, s: a sextant in which a falling phase shows none is behind the rotor, or
/// does not turn it.
const PATIENCE_S: f32 = 4e-3;

/// Time for which a start's first attempt may go on without a full turn of consecutive crossings, s. Of 300 random
/// motors, half are in Run after 0.05 s.
const ASTRAY_S: f32 = 0.12;

/// Advance of the commutation at full duty, degrees.
const ADVANCE_DEG: f32 = 30.0;

/// Periods per sextant at the fastest speed that is followed.
const FASTEST_PERIODS: f32 = 3.5;

/// Loss of duty where that speed is exceeded, over the excess.
const HOLD: f32 = 4.0;

/// Greatest current against the rotation over `LIM_PHASE_A`.
const BRAKING_SHARE: f32 = 0.25;

/// Returns the fastest speed that the samples follow.
pub(super) fn fastest() -> Speed {
    Speed::from_f32(1.0 / 6.0 / FASTEST_PERIODS)
}

pub(super) fn six_step(p: &Si, duty_max: f32, place: &mut Config) {
    p.refuse_above(
        6.0 * p.fastest_turns * LEAST_PERIODS,
        1.0,
        ParamId::PwmFreqHz,
        TOO_FEW_PERIODS,
    );
    outer::planner(p, p.outer_t, &mut place.planner);
    let crossing = &mut place.crossing;
    let v_per_count = p.board.terminal_v_per_count;
    crossing.least = p.voltage((LEAST_COUNTS * v_per_count).max(LEAST_V));
    crossing.greatest = p.voltage(GREATEST_COUNTS * v_per_count);
    crossing.delayed = match p.board.delay {
        Delay::None(_) | Delay::Half(_) => 0,
        Delay::One => 1,
    };
    let duty = &mut place.duty;
    let k_p = PROPORTIONAL / p.fastest_turns;
    let corner_rad_s = CORNER_SHARE * TAU * p.settings.speed_hz;
    let bound_a = p.limit_a.max(BOUND_LEAST_A);
    duty.k_p = p.gain(ParamId::CtlRpmMax, k_p);
    duty.k_i = p.gain(ParamId::CtlBwSpdHz, k_p * corner_rad_s * p.outer_t);
    duty.k_b = p.gain(ParamId::LimPhaseA, BOUND_RATE * p.t * p.unit_a / bound_a);
    duty.lead_to_zero_max = p.scale.current_from_a(LEAD_SHARE * p.limit_a);
    duty.duty_max = I1F31::from_f32(duty_max);
    duty.rest = WHOLE - duty.duty_max;
    let rest = duty.rest.to_f32();
    place.whole = match p.board.shunts {
        Shunts::Three => WHOLE,
        // The low leg may be the one without a shunt.
        Shunts::Two => duty.duty_max,
    };
    place.advance = p.gain(ParamId::PwmFreqHz, ADVANCE_DEG / 360.0 / rest);
    place.fastest = fastest();
    place.hold = p.gain(ParamId::PwmFreqHz, HOLD / place.fastest.to_f32());
    place.whole_from = Speed::from_f32(TAU * OVERMODULATION_HZ / p.rad_per_unit);
    place.delay = p.board.delay;
    place.patience = p.periods(PATIENCE_S) as u16;
    place.astray = p.periods(ASTRAY_S) as u16;
    let settings = &p.settings;
    place.terminal = p.gain(ParamId::LimBusVMax, v_per_count / p.unit_v);
    place.braking = p.scale.current_from_a(BRAKING_SHARE * p.limit_a);
    place.start_current = p.scale.current_from_a(p.start_a);
    place.test_current = p.scale.current_from_a(TEST_SHARE * p.limit_a);
    place.run_speed = p.scale.speed_from_rpm(settings.run_rpm);
    place.slow = p.scale.speed_from_rpm(p.slow_rpm);
}
