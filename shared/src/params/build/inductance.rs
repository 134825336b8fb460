//! Coefficients of the inductance adaptation.

use super::formula::fill;
use super::si::Si;
use crate::control::inductance::{Config, MEAN_PERIODS_MAX};
use crate::params::choice::CtlAdaptL;
use crate::parts;

/// Half the square wave's height over `LIM_PHASE_A`: 1 A on the bench.
const AMPLITUDE_SHARE: f32 = 0.05;

/// Half a wave, s: 50 Hz.
const HALF_S: f32 = 0.01;

/// Share of the observed error that one half wave corrects.
const STEP: f32 = 0.1;

/// Sets up the adaptation if `CTL_ADAPT_L` asks for it.
pub(super) fn inductance(p: &Si, place: &mut Option<Config>) {
    *place = None;
    let (CtlAdaptL::On, Some(part)) = (p.choice(), parts::AdaptL::get()) else {
        return;
    };
    let place = place.insert(Config::new(part));
    fill!(p, place, {
        number amplitude([AMPLITUDE_SHARE] * LimitA / UnitA),
        count half_periods([HALF_S] / T),
        gain gain(MotLUh, [STEP] * UnitWb / UnitA / L),
    });
    place.mean_periods = (place.half_periods / 4).min(MEAN_PERIODS_MAX);
}
