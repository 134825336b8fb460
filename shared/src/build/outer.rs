//! Coefficients of the outer loop.

use core::f32::consts::TAU;

use siskin_params::choice::{CtlObserver, CtlRegulator, CtlSpeed};
use siskin_params::{ParamId, parts};
use siskin_units::Speed;
use siskin_units::math::{Gain, Real, SQRT_3};

use super::si::Si;
use crate::control::speed::{Config, Law, feed_forward, nested};
use crate::control::{planner, torque, weakening};

/// k_iω/k_pω over k_pω/J: Table III has 5.87 against 49.65 1/s.
const SPEED_CORNER_SHARE: f32 = 0.1183;

/// Both poles of the default speed loop over the bandwidth.
const POLE_SHARE: f32 = 0.8;

/// λ of the trajectory's landing over the bandwidth: slower than the poles, so that the effect of a
/// 30 % error in the inertia decays before the landing does, and nothing overshoots.
const LANDING_SHARE: f32 = 0.6;

/// Back-EMF over the ramp current's drop across R, at the speed above which speed errors are
/// corrected in full: 400 rpm on the bench.
const TRUST_EMF: f32 = 1.5;

/// [`nested::Config::trust`] that corrects speed errors in full from a ten-thousandth of a turn per period.
const TRUST_ALWAYS: f32 = 5_000.0;

/// Time in which ω̇* rises from zero to the slew, s: a few times the current loop's response.
const JERK_S: f32 = 0.005;

/// Least time in which i_q* goes from zero to `LIM_PHASE_A`, s.
const TORQUE_S: f32 = 0.003;

/// Least time in which a driving i_q* grows by the current whose flux is the rotor's, s. In slams with L stated 30 %
/// wrong it keeps the angle error of idle to 11°, where 5 ms reaches 20°.
const GROWTH_S: f32 = 0.008;

/// Both times of the modified regulator over the others': it does not decouple, and at 6000 rpm on
/// the bench its slow pole pair is at 870 1/s where theirs are at 2357.
const MODIFIED_SLOWER: f32 = 4.0;

/// Sets up torque and voltage mode.
pub(super) fn torque(p: &Si, place: &mut torque::Config) {
    let slew_a_s = p.limit_a / (TORQUE_S * slower(p));
    let growth_a_s = (p.flux / p.l / GROWTH_S).min(slew_a_s);
    place.slew = p.scale.current_from_a(slew_a_s * p.outer_t);
    place.growth = p.scale.current_from_a(growth_a_s * p.outer_t);
    if !p.is_helped() {
        // Sensors do not take the growth for a turn of the rotor, and the first paper has no such limit.
        place.growth = place.slew;
    }
}

/// Greatest current along −d over `LIM_PHASE_A`.
const WEAKENING_SHARE: f32 = 0.8;

/// Time in which i_d makes up for missing voltage, s, at the speed where it ends; longer below.
const WEAKENING_S: f32 = 0.008;

/// Sets up flux weakening. The first paper's observer and both papers' other regulators stay as published.
pub(super) fn weakening(p: &Si, place: &mut weakening::Config) {
    if !p.is_helped() || !p.chosen(CtlRegulator::Synchronous) {
        return;
    }
    let most_a = (0.01 * p.get(ParamId::CtlWeaken) * p.flux / p.l).min(WEAKENING_SHARE * p.limit_a);
    let end_rad_s = p.supply_max_v / (SQRT_3 * p.flux);
    let a_per_v = p.t / WEAKENING_S / (end_rad_s * p.l);
    place.most = p.scale.current_from_a(most_a);
    // The type ends at 1/32; where that binds, i_d follows more slowly.
    let rate = (a_per_v * p.unit_v / p.unit_a).min(0.03);
    place.rate = p.factor(ParamId::MotLUh, rate);
    place.end = Speed::from_f32(end_rad_s / p.rad_per_unit);
}

/// Returns the factor of both times.
fn slower(p: &Si) -> f32 {
    if p.chosen(CtlRegulator::Modified) {
        MODIFIED_SLOWER
    } else {
        1.0
    }
}

/// Sets up the speed regulator that `CTL_SPEED` selects, and its planner.
pub(super) fn speed(p: &Si, place: &mut Config) {
    planner(p, p.outer_t, &mut place.planner);
    let law = p.choice();
    match law {
        CtlSpeed::Inertia | CtlSpeed::Pi => place.law = Law::Nested(nested::Config::default()),
        CtlSpeed::Propeller => {
            if let Some(part) = parts::Propeller::get() {
                place.law = Law::FeedForward(feed_forward::Config::default(), part);
            }
        }
    }
    match &mut place.law {
        Law::Nested(place) if law == CtlSpeed::Pi => published(p, place),
        Law::Nested(place) => with_inertia(p, place),
        Law::FeedForward(place, _) => feed_forward(p, place),
    }
}

/// Sets up the planner of a speed regulator that runs once per `period_s`.
pub(super) fn planner(p: &Si, period_s: f32, place: &mut planner::Config) {
    place.slew = p.scale.speed_from_rpm(p.settings.slew_rpm_s * period_s);
    // How ω* starts and stops moving: softly, or limited by the slew alone as in the papers.
    match p.choice() {
        CtlSpeed::Inertia => {
            let jerk = place.slew.to_f32() * period_s / (JERK_S * slower(p));
            place.jerk = Speed::from_f32(jerk);
            place.approach = p.gain(
                ParamId::CtlBwSpdHz,
                LANDING_SHARE * p.speed_rad_s * period_s,
            );
        }
        CtlSpeed::Propeller | CtlSpeed::Pi => {
            place.jerk = Speed::MAX;
            place.approach = p.gain(ParamId::CtlBwSpdHz, 1.0);
        }
    }
}

/// Sets up (8) with gains in the ratio of Table III.
fn published(p: &Si, place: &mut nested::Config) {
    let k_p = p.j * p.speed_rad_s;
    let k_i = k_p * SPEED_CORNER_SHARE * p.speed_rad_s * p.outer_t;
    place.k_p = p.gain(ParamId::CtlBwSpdHz, k_p * p.torque_per_speed);
    place.k_i = p.gain(ParamId::CtlBwSpdHz, k_i * p.torque_per_speed);
    place.trust = p.gain(ParamId::CtlBwSpdHz, TRUST_ALWAYS);
    place.with_step = reads_step(p);
}

/// Sets up (8) with both poles faster than the trajectory's landing: J·s² + k_pω·s + k_iω.
fn with_inertia(p: &Si, place: &mut nested::Config) {
    let pole_rad_s = POLE_SHARE * p.speed_rad_s;
    let k_p = 2.0 * pole_rad_s * p.j;
    let k_i = pole_rad_s * pole_rad_s * p.j * p.outer_t;
    let inertia = p.j / p.outer_t * p.torque_per_speed;
    place.k_p = p.gain(ParamId::CtlBwSpdHz, k_p * p.torque_per_speed);
    place.k_i = p.gain(ParamId::CtlBwSpdHz, k_i * p.torque_per_speed);
    place.inertia = p.gain(ParamId::MotJGcm2, inertia);
    place.inertia_inverse = p.gain(ParamId::MotJGcm2, 1.0 / inertia);
    place.trust = if p.chosen(CtlObserver::Hall) {
        // Sensors do not depend on R.
        p.gain(ParamId::CtlBwSpdHz, TRUST_ALWAYS)
    } else {
        let trusted_rad_s = TRUST_EMF * p.r * p.settings.ramp_a / p.flux;
        p.gain(ParamId::StaRampA, 0.5 / (trusted_rad_s * p.t / TAU))
    };
    place.with_step = reads_step(p);
}

/// Returns true for the observer-based regulator, the only one that reads p_q*.
fn reads_step(p: &Si) -> bool {
    p.chosen(CtlRegulator::ObserverBased)
}

/// Sets up the feed-forward loop of the second paper's figure 47.
fn feed_forward(p: &Si, place: &mut feed_forward::Config) {
    let fastest = p.scale.speed_from_rpm(p.fastest_rpm).to_f32();
    let a_per_nm = 1.0 / (1.5 * p.pole_pairs * p.flux);
    let k_p = p.j * p.speed_rad_s * a_per_nm;
    let k_i = k_p * SPEED_CORNER_SHARE * p.speed_rad_s * p.outer_t;
    let current_per_speed = p.unit_rad_s / p.unit_a;
    let propeller_a = p.get(ParamId::CtlFfA);
    place.k_p = p.gain(ParamId::CtlBwSpdHz, k_p * current_per_speed);
    place.k_i = p.gain(ParamId::CtlBwSpdHz, k_i * current_per_speed);
    place.k_ffi = p.gain(
        ParamId::CtlFfA,
        propeller_a / p.unit_a / (fastest * fastest),
    );
    place.k_ffv = p.gain(ParamId::MotFluxMwb, p.flux * TAU / p.t / p.unit_v);
    place.own = if p.chosen(CtlRegulator::Modified) {
        Gain::ZERO
    } else {
        place.k_ffv
    };
}
