//! The coefficients of the tones.

use super::formula::fill;
use super::quantity::Quantity;
use super::si::Si;
use crate::drive::config::tone::Config;

/// Share of `MOT_TONE_A` that the peaks are led to. The dead time's part of a half cycle depends on
/// where the samples fall in it, so they vary by up to a quarter from one to the next.
const LED_SHARE: f32 = 0.75;

/// Greatest bound of a tone's current, of `LIM_PHASE_A`: with the voltage that twice as much needs, all
/// that a sensor without a reading leaves in place, the limit still holds.
const LIMIT_SHARE: f32 = 0.5;

/// Loss to the dead time of a vector along a phase, over that of one phase: the current flows in by one
/// and out by two, 1 + 1/3.
const DEAD_TIME_VECTOR: f32 = 4.0 / 3.0;

/// The tones of `MOT_TONE_A`; none if it is 0.
pub(super) fn tone(p: &Si, place: &mut Option<Config>) {
    *place = None;
    if p.of(Quantity::ToneA) == 0.0 {
        return;
    }
    let place = place.insert(Config::default());
    fill!(p, place, {
        define BoundA([LIMIT_SHARE] * LimitA min ToneA),
        define LedA([LED_SHARE] * BoundA),
        number peak(LedA / UnitA),
        gain share(MotToneA, UnitA / LedA),
        number resistive(R * LedA / UnitV),
        gain reactive(MotLUh, Tau * L / T * LedA / UnitV),
        number dead([DEAD_TIME_VECTOR] * DeadTime / T),
    });
}
