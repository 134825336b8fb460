//! The coefficients of the inductance's adaptation.

use super::si::Si;
use crate::control::inductance::{Config, MEAN_PERIODS_MAX};
use crate::params::ParamId;
use crate::params::choice::CtlAdaptL;

/// Half the square wave's height over `LIM_PHASE_A`: 1 A on the bench.
const AMPLITUDE_SHARE: f32 = 0.05;

/// Half a wave, s: 50 Hz.
const HALF_S: f32 = 0.01;

/// Share of the error shown that one half wave corrects.
const STEP: f32 = 0.1;

/// The adaptation, if `CTL_ADAPT_L` asks for it.
pub(super) fn inductance(p: &Si) -> Option<Config> {
    if p.chosen(CtlAdaptL::Off) {
        return None;
    }
    let half_periods = (HALF_S / p.period_s) as u32;
    Some(Config {
        amplitude: p
            .scale
            .current_from_a(AMPLITUDE_SHARE * p.get(ParamId::LimPhaseA)),
        half_periods,
        mean_periods: (half_periods / 4).min(MEAN_PERIODS_MAX),
        gain: p.gain(
            ParamId::MotLUh,
            STEP * p.scale.flux_wb() / p.scale.current_a / p.inductance_h,
        ),
    })
}
