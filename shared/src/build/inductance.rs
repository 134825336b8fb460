//! Coefficients of the inductance adaptation.

use siskin_params::choice::CtlAdaptL;
use siskin_params::{ParamId, parts};

use super::si::Si;
use crate::control::inductance::{Config, MEAN_PERIODS_MAX};

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
    place.amplitude = p.scale.current_from_a(AMPLITUDE_SHARE * p.limit_a);
    place.half_periods = p.periods(HALF_S);
    place.gain = p.gain(ParamId::MotLUh, STEP * p.unit_wb / p.unit_a / p.l);
    place.mean_periods = (place.half_periods / 4).min(MEAN_PERIODS_MAX);
}
