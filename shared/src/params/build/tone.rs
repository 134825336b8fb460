//! Coefficients of the tones.

use super::formula::fill;
use super::quantity::Quantity;
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
