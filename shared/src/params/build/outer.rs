//! Coefficients of the outer loop.

use super::formula::fill;
use super::quantity::Quantity;
use super::si::Si;
use crate::control::speed::{Config, Law, feed_forward, nested};
use crate::control::{planner, torque};
use crate::math::{Gain, Real};
use crate::params::choice::{CtlObserver, CtlRegulator, CtlSpeed};
use crate::parts;
use crate::units::Speed;

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
    define_slower(p);
    fill!(p, place, {
        define SlowerS([TORQUE_S] * Slower),
        define SlewAS(LimitA / SlowerS),
        number slew(SlewAS * OuterT / UnitA),
        define GrowthAS(Flux / L / [GROWTH_S] min SlewAS),
        number growth(GrowthAS * OuterT / UnitA),
    });
    if !p.is_helped() {
        // Sensors do not take the growth for a turn of the rotor, and the first paper has no such limit.
        place.growth = place.slew;
    }
}

/// Defines the factor of both times.
fn define_slower(p: &Si) {
    let slower = if p.chosen(CtlRegulator::Modified) {
        MODIFIED_SLOWER
    } else {
        1.0
    };
    p.set(Quantity::Slower, slower);
}

/// Sets up the speed regulator that `CTL_SPEED` selects, and its planner.
pub(super) fn speed(p: &Si, place: &mut Config) {
    planner(p, Quantity::OuterT, &mut place.planner);
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

/// Sets up the planner of a speed regulator that runs once per `period`.
pub(super) fn planner(p: &Si, period: Quantity, place: &mut planner::Config) {
    p.set(Quantity::PlannerT, p.of(period));
    fill!(p, place, { number slew(SlewRpmS * PlannerT * TurnsPerRpm) });
    // How ω* starts and stops moving: softly, or limited by the slew alone as in the papers.
    match p.choice() {
        CtlSpeed::Inertia => {
            define_slower(p);
            p.set(Quantity::Slew, place.slew.to_f32());
            fill!(p, place, {
                define SlowerS([JERK_S] * Slower),
                number jerk(Slew * PlannerT / SlowerS),
                gain approach(CtlBwSpdHz, [LANDING_SHARE] * SpeedRadS * PlannerT),
            });
        }
        CtlSpeed::Propeller | CtlSpeed::Pi => {
            place.jerk = Speed::MAX;
            fill!(p, place, { gain approach(CtlBwSpdHz, [1.0]) });
        }
    }
}

/// Sets up (8) with gains in the ratio of Table III.
fn published(p: &Si, place: &mut nested::Config) {
    fill!(p, place, {
        gain k_p(CtlBwSpdHz, J * SpeedRadS * TorquePerSpeed),
        gain k_i(
            CtlBwSpdHz,
            J * SpeedRadS * [SPEED_CORNER_SHARE] * SpeedRadS * OuterT * TorquePerSpeed
        ),
        // In full from a ten-thousandth of a turn per period.
        gain trust(CtlBwSpdHz, [5_000.0]),
    });
    place.with_step = reads_step(p);
}

/// Sets up (8) with both poles faster than the trajectory's landing: J·s² + k_pω·s + k_iω.
fn with_inertia(p: &Si, place: &mut nested::Config) {
    fill!(p, place, {
        define PoleRadS([POLE_SHARE] * SpeedRadS),
        gain k_p(CtlBwSpdHz, [2.0] * PoleRadS * J * TorquePerSpeed),
        gain k_i(CtlBwSpdHz, PoleRadS * PoleRadS * J * OuterT * TorquePerSpeed),
        define Inertia(J / OuterT * TorquePerSpeed),
        gain inertia(MotJGcm2, Inertia),
        gain inertia_inverse(MotJGcm2, [1.0] / Inertia),
    });
    if p.chosen(CtlObserver::Hall) {
        // Sensors do not depend on R.
        fill!(p, place, { gain trust(CtlBwSpdHz, [5_000.0]) });
    } else {
        fill!(p, place, {
            define Trusted([TRUST_EMF] * R * RampA / Flux * T / Tau),
            gain trust(StaRampA, [0.5] / Trusted),
        });
    }
    place.with_step = reads_step(p);
}

/// Returns true for the observer-based regulator, the only one that reads p_q*.
fn reads_step(p: &Si) -> bool {
    p.chosen(CtlRegulator::ObserverBased)
}

/// Sets up the feed-forward loop of the second paper's figure 47.
fn feed_forward(p: &Si, place: &mut feed_forward::Config) {
    let fastest = p.scale.speed_from_rpm(p.of(Quantity::FastestRpm));
    p.set(Quantity::Fastest, fastest.to_f32());
    fill!(p, place, {
        define NmPerA([1.5] * PolePairs * Flux),
        define APerNm([1.0] / NmPerA),
        define CurrentPerSpeed(UnitRadS / UnitA),
        gain k_p(CtlBwSpdHz, J * SpeedRadS * APerNm * CurrentPerSpeed),
        gain k_i(
            CtlBwSpdHz,
            J * SpeedRadS * APerNm * [SPEED_CORNER_SHARE] * SpeedRadS * OuterT * CurrentPerSpeed
        ),
        define FastestSquare(Fastest * Fastest),
        gain k_ffi(CtlFfA, PropellerA / UnitA / FastestSquare),
        gain k_ffv(MotFluxMwb, Flux * Tau / T / UnitV),
    });
    place.own = if p.chosen(CtlRegulator::Modified) {
        Gain::ZERO
    } else {
        place.k_ffv
    };
}
