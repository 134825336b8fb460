//! The outer loop's coefficients.

use core::f32::consts::TAU;

use super::{BuildError, Si, gain};
use crate::control::speed::{Config, Law, feed_forward, nested};
use crate::control::{planner, torque};
use crate::math::Gain;
use crate::params::{ParamId, Params};
use crate::units::{Scale, Speed};

/// k_iω/k_pω over k_pω/J: Table III has 5.87 against 49.65 1/s.
const SPEED_CORNER_SHARE: f32 = 0.1183;

/// Both poles of the default speed loop over the bandwidth.
const POLE_SHARE: f32 = 0.8;

/// λ of the trajectory's landing over the bandwidth: slower than the poles, so that what an inertia
/// that is wrong by 30 % leaves behind has decayed before the landing has, and nothing overshoots.
const LANDING_SHARE: f32 = 0.6;

/// Back-EMF over the drop of the ramp's current across R, at the speed from which the speed's error
/// is acted on in full: 400 rpm on the bench.
const TRUST_EMF: f32 = 1.5;

/// Time in which ω̇* goes from rest to the slew, s: a few times that of the current loop's answer.
const JERK_S: f32 = 0.005;

/// Time in which i_q* may go from zero to `LIM_PHASE_A`, s.
const TORQUE_S: f32 = 0.003;

/// Both times for the modified regulator, over those for the others: it decouples nothing, and at
/// 6000 rpm on the bench its slow pair of poles is at 870 1/s where theirs are at 2357.
const MODIFIED_SLOWER: f32 = 4.0;

fn slower(params: &Params) -> f32 {
    match params.get(ParamId::CtlRegulator) {
        2.0 => MODIFIED_SLOWER,
        _ => 1.0,
    }
}

/// Torque and voltage mode.
pub(super) fn torque(params: &Params, p: &Si, scale: &Scale) -> torque::Config {
    let a_per_s = params.get(ParamId::LimPhaseA) / (TORQUE_S * slower(params));
    torque::Config {
        slew: scale.current_from_a(a_per_s * p.period_s),
    }
}

/// The speed regulator that `CTL_SPEED` names, and its planner.
pub(super) fn speed(params: &Params, p: &Si, scale: &Scale) -> Result<Config, BuildError> {
    let slew = scale.speed_from_rpm(params.get(ParamId::CtlSlewRpmS) * p.period_s);
    let soft = Profile {
        approach: LANDING_SHARE * p.speed_rad_s * p.period_s,
        jerk: Speed::saturating_from_num(
            slew.to_num::<f32>() * p.period_s / (JERK_S * slower(params)),
        ),
    };
    let hard = Profile {
        approach: 1.0,
        jerk: Speed::MAX,
    };
    let (law, profile) = match params.get(ParamId::CtlSpeed) {
        0.0 => (Law::Nested(with_inertia(params, p, scale)?), soft),
        1.0 => (Law::FeedForward(feed_forward(params, p, scale)?), hard),
        _ => (Law::Nested(published(params, p, scale)?), hard),
    };
    Ok(Config {
        planner: planner::Config {
            slew,
            jerk: profile.jerk,
            approach: gain(ParamId::CtlBwSpdHz, profile.approach)?,
        },
        law,
    })
}

/// How ω* begins and ends to move: softly, or by the slew alone as in the papers.
struct Profile {
    approach: f32,
    jerk: Speed,
}

/// (8) with gains in the ratio of Table III.
fn published(params: &Params, p: &Si, scale: &Scale) -> Result<nested::Config, BuildError> {
    let k_p = p.inertia_kgm2 * p.speed_rad_s;
    let k_i = k_p * SPEED_CORNER_SHARE * p.speed_rad_s;
    let torque = torque_per_speed(p, scale);
    Ok(nested::Config {
        k_p: gain(ParamId::CtlBwSpdHz, k_p * torque)?,
        k_i: gain(ParamId::CtlBwSpdHz, k_i * p.period_s * torque)?,
        inertia: Gain::ZERO,
        inertia_inverse: Gain::ZERO,
        // In full from a ten-thousandth of a turn a period.
        trust: gain(ParamId::CtlBwSpdHz, 5_000.0)?,
        with_step: reads_step(params),
    })
}

/// (8) with both poles faster than the trajectory's landing: J·s² + k_pω·s + k_iω.
fn with_inertia(params: &Params, p: &Si, scale: &Scale) -> Result<nested::Config, BuildError> {
    let pole_rad_s = POLE_SHARE * p.speed_rad_s;
    let k_p = 2.0 * pole_rad_s * p.inertia_kgm2;
    let k_i = pole_rad_s * pole_rad_s * p.inertia_kgm2;
    let torque = torque_per_speed(p, scale);
    let inertia = p.inertia_kgm2 / p.period_s * torque;
    let trusted_rad_s = TRUST_EMF * p.resistance_ohm * params.get(ParamId::StaRampA) / p.flux_wb;
    let trusted = trusted_rad_s * p.period_s / TAU;
    Ok(nested::Config {
        k_p: gain(ParamId::CtlBwSpdHz, k_p * torque)?,
        k_i: gain(ParamId::CtlBwSpdHz, k_i * p.period_s * torque)?,
        inertia: gain(ParamId::MotJGcm2, inertia)?,
        inertia_inverse: gain(ParamId::MotJGcm2, 1.0 / inertia)?,
        trust: match params.get(ParamId::CtlObserver) {
            // Sensors know R as little as they need to.
            2.0 => gain(ParamId::CtlBwSpdHz, 5_000.0)?,
            _ => gain(ParamId::StaRampA, 0.5 / trusted)?,
        },
        with_step: reads_step(params),
    })
}

/// Only the observer-based regulator reads p_q*.
fn reads_step(params: &Params) -> bool {
    params.get(ParamId::CtlRegulator) == 0.0
}

/// Second paper, figure 47.
fn feed_forward(
    params: &Params,
    p: &Si,
    scale: &Scale,
) -> Result<feed_forward::Config, BuildError> {
    let ampere_per_nm = 1.0 / (1.5 * p.pole_pairs * p.flux_wb);
    let k_p = p.inertia_kgm2 * p.speed_rad_s * ampere_per_nm;
    let k_i = k_p * SPEED_CORNER_SHARE * p.speed_rad_s;
    let current_per_speed = TAU / (p.pole_pairs * p.period_s) / scale.current_a;
    let fastest = scale
        .speed_from_rpm(params.get(ParamId::CtlRpmMax))
        .to_num::<f32>();
    let steady = params.get(ParamId::CtlFfA) / scale.current_a;
    let flux = gain(
        ParamId::MotFluxMwb,
        p.flux_wb * TAU / p.period_s / scale.voltage_v,
    )?;
    Ok(feed_forward::Config {
        k_p: gain(ParamId::CtlBwSpdHz, k_p * current_per_speed)?,
        k_i: gain(ParamId::CtlBwSpdHz, k_i * p.period_s * current_per_speed)?,
        k_ffi: gain(ParamId::CtlFfA, steady / (fastest * fastest))?,
        k_ffv: flux,
        own: match params.get(ParamId::CtlRegulator) {
            2.0 => Gain::ZERO,
            _ => flux,
        },
    })
}

/// Nm per mechanical rad/s in the control's units.
fn torque_per_speed(p: &Si, scale: &Scale) -> f32 {
    TAU / (p.pole_pairs * p.period_s) / scale.torque_nm()
}
