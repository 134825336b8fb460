//! Coefficients of the tones.

use core::f32::consts::TAU;

use siskin_params::ParamId;
use siskin_units::math::Real;

use super::si::Si;
use crate::drive::config::tone::Config;

/// Share of `MOT_TONE_A` that the peaks are driven to. The dead time's part of a half cycle depends on where the
/// samples fall, so peaks vary by up to a quarter from one to the next.
const LED_SHARE: f32 = 0.75;

/// Greatest bound of a tone's current over `LIM_PHASE_A`: if a sensor reads nothing, only the voltage bound remains,
/// which allows twice as much, and the limit still holds.
const LIMIT_SHARE: f32 = 0.5;

/// Dead-time loss of a vector along a phase over that of one phase: the current flows in through one and out through
/// two, 1 + 1/3.
const DEAD_TIME_VECTOR: f32 = 4.0 / 3.0;

/// Sets up the tones of `MOT_TONE_A`; none if it is 0.
pub(super) fn tone(p: &Si, place: &mut Option<Config>) {
    *place = None;
    let tone_a = p.get(ParamId::MotToneA);
    if tone_a == 0.0 {
        return;
    }
    let place = place.insert(Config::default());
    let led_a = LED_SHARE * (LIMIT_SHARE * p.limit_a).min(tone_a);
    place.peak = p.scale.current_from_a(led_a);
    place.share = p.gain(ParamId::MotToneA, p.unit_a / led_a);
    place.resistive = p.voltage(p.r * led_a);
    place.reactive = p.gain(ParamId::MotLUh, TAU * p.l / p.t * led_a / p.unit_v);
    place.dead = Real::from_f32(DEAD_TIME_VECTOR * p.dead_time_s / p.t);
}
