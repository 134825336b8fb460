//! The coefficients of the tones.

use core::f32::consts::TAU;

use fixed::types::I1F31;

use super::si::Si;
use crate::drive::config::tone::Config;
use crate::math::Real;
use crate::params::ParamId;
use crate::units::Voltage;

/// Share of `MOT_TONE_A` that the peaks are led to. The dead time's part of a half cycle depends on
/// where the samples fall in it, so they vary by up to a quarter from one to the next.
const LED_SHARE: f32 = 0.75;

/// Greatest bound of a tone's current, of `LIM_PHASE_A`: with the voltage that twice as much needs, all
/// that a sensor without a reading leaves in place, the limit still holds.
const LIMIT_SHARE: f32 = 0.5;

/// Loss to the dead time of a vector along a phase, over that of one phase: the current flows in by one
/// and out by two, 1 + 1/3.
const DEAD_TIME_VECTOR: f32 = 4.0 / 3.0;

/// The tones of `MOT_TONE_A`; `None` if it is 0.
pub(super) fn tone(p: &Si) -> Option<Config> {
    let limit_a = LIMIT_SHARE * p.get(ParamId::LimPhaseA);
    let bound_a = p.get(ParamId::MotToneA).min(limit_a);
    if bound_a == 0.0 {
        return None;
    }
    let led_a = LED_SHARE * bound_a;
    let units = |ohm: f32| ohm * led_a / p.scale.voltage_v;
    Some(Config {
        peak: p.scale.current_from_a(led_a),
        share: p.gain(ParamId::MotToneA, p.scale.current_a / led_a),
        resistive: Voltage::from_f32(units(p.resistance_ohm)),
        reactive: p.gain(ParamId::MotLUh, units(TAU * p.inductance_h / p.period_s)),
        dead: I1F31::from_f32(DEAD_TIME_VECTOR * p.dead_time_s / p.period_s),
    })
}
