//! The outer loop's coefficients.

use core::f32::consts::TAU;

use super::si::Si;
use crate::control::speed::{Config, Law, feed_forward, nested};
use crate::control::{PERIODS, planner, torque};
use crate::math::{Gain, Real};
use crate::params::ParamId;
use crate::params::choice::{CtlObserver, CtlRegulator, CtlSpeed};
use crate::units::Speed;

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

fn slower(p: &Si) -> f32 {
    if p.chosen(CtlRegulator::Modified) {
        MODIFIED_SLOWER
    } else {
        1.0
    }
}

/// A period of the outer loops, s.
fn period_s(p: &Si) -> f32 {
    PERIODS as f32 * p.period_s
}

/// Torque and voltage mode.
pub(super) fn torque(p: &Si) -> torque::Config {
    let a_per_s = p.get(ParamId::LimPhaseA) / (TORQUE_S * slower(p));
    torque::Config {
        slew: p.scale.current_from_a(a_per_s * period_s(p)),
    }
}

/// The speed regulator that `CTL_SPEED` names, and its planner.
pub(super) fn speed(p: &Si) -> Config {
    Config {
        planner: planner(p, period_s(p)),
        law: match p.choice() {
            CtlSpeed::Inertia => Law::Nested(with_inertia(p)),
            CtlSpeed::Propeller => Law::FeedForward(feed_forward(p)),
            CtlSpeed::Pi => Law::Nested(published(p)),
        },
    }
}

/// The planner of a speed regulator that acts once in `period_s`.
pub(super) fn planner(p: &Si, period_s: f32) -> planner::Config {
    let slew = p.scale.speed_from_rpm(p.from_motor.slew_rpm_s * period_s);
    // How ω* begins and ends to move: softly, or by the slew alone as in the papers.
    let (approach, jerk) = match p.choice() {
        CtlSpeed::Inertia => {
            let jerk = slew.to_f32() * period_s / (JERK_S * slower(p));
            let approach = LANDING_SHARE * p.speed_rad_s * period_s;
            (approach, Speed::from_f32(jerk))
        }
        CtlSpeed::Propeller | CtlSpeed::Pi => (1.0, Speed::MAX),
    };
    planner::Config {
        slew,
        jerk,
        approach: p.gain(ParamId::CtlBwSpdHz, approach),
    }
}

/// (8) with gains in the ratio of Table III.
fn published(p: &Si) -> nested::Config {
    let k_p = p.inertia_kgm2 * p.speed_rad_s;
    let k_i = k_p * SPEED_CORNER_SHARE * p.speed_rad_s;
    let torque = torque_per_speed(p);
    nested::Config {
        k_p: p.gain(ParamId::CtlBwSpdHz, k_p * torque),
        k_i: p.gain(ParamId::CtlBwSpdHz, k_i * period_s(p) * torque),
        inertia: Gain::ZERO,
        inertia_inverse: Gain::ZERO,
        // In full from a ten-thousandth of a turn a period.
        trust: p.gain(ParamId::CtlBwSpdHz, 5_000.0),
        with_step: reads_step(p),
    }
}

/// (8) with both poles faster than the trajectory's landing: J·s² + k_pω·s + k_iω.
fn with_inertia(p: &Si) -> nested::Config {
    let pole_rad_s = POLE_SHARE * p.speed_rad_s;
    let k_p = 2.0 * pole_rad_s * p.inertia_kgm2;
    let k_i = pole_rad_s * pole_rad_s * p.inertia_kgm2;
    let torque = torque_per_speed(p);
    let inertia = p.inertia_kgm2 / period_s(p) * torque;
    let trusted_rad_s = TRUST_EMF * p.resistance_ohm * p.from_motor.ramp_a / p.flux_wb;
    let trusted = trusted_rad_s * p.period_s / TAU;
    nested::Config {
        k_p: p.gain(ParamId::CtlBwSpdHz, k_p * torque),
        k_i: p.gain(ParamId::CtlBwSpdHz, k_i * period_s(p) * torque),
        inertia: p.gain(ParamId::MotJGcm2, inertia),
        inertia_inverse: p.gain(ParamId::MotJGcm2, 1.0 / inertia),
        trust: if p.chosen(CtlObserver::Hall) {
            // Sensors know R as little as they need to.
            p.gain(ParamId::CtlBwSpdHz, 5_000.0)
        } else {
            p.gain(ParamId::StaRampA, 0.5 / trusted)
        },
        with_step: reads_step(p),
    }
}

/// Only the observer-based regulator reads p_q*.
fn reads_step(p: &Si) -> bool {
    p.chosen(CtlRegulator::ObserverBased)
}

/// Second paper, figure 47.
fn feed_forward(p: &Si) -> feed_forward::Config {
    let ampere_per_nm = 1.0 / (1.5 * p.pole_pairs * p.flux_wb);
    let k_p = p.inertia_kgm2 * p.speed_rad_s * ampere_per_nm;
    let k_i = k_p * SPEED_CORNER_SHARE * p.speed_rad_s;
    let current_per_speed = TAU / (p.pole_pairs * p.period_s) / p.scale.current_a;
    let fastest = p.scale.speed_from_rpm(p.get(ParamId::CtlRpmMax)).to_f32();
    let steady = p.get(ParamId::CtlFfA) / p.scale.current_a;
    let flux = p.gain(
        ParamId::MotFluxMwb,
        p.flux_wb * TAU / p.period_s / p.scale.voltage_v,
    );
    feed_forward::Config {
        k_p: p.gain(ParamId::CtlBwSpdHz, k_p * current_per_speed),
        k_i: p.gain(ParamId::CtlBwSpdHz, k_i * period_s(p) * current_per_speed),
        k_ffi: p.gain(ParamId::CtlFfA, steady / (fastest * fastest)),
        k_ffv: flux,
        own: if p.chosen(CtlRegulator::Modified) {
            Gain::ZERO
        } else {
            flux
        },
    }
}

/// Nm per mechanical rad/s in the control's units.
fn torque_per_speed(p: &Si) -> f32 {
    TAU / (p.pole_pairs * p.period_s) / p.scale.torque_nm()
}
