//! The coefficients of the inductance's adaptation.

use super::{BuildError, Si, gain};
use crate::control::inductance::{Config, MEAN_PERIODS_MAX};
use crate::params::{ParamId, Params};
use crate::units::Scale;

/// Half the square wave's height over `LIM_PHASE_A`: 1 A on the bench.
const AMPLITUDE_SHARE: f32 = 0.05;

/// Half a wave, s: 50 Hz.
const HALF_S: f32 = 0.01;

/// What one half wave takes of the error that it shows.
const STEP: f32 = 0.1;

/// The adaptation, where `CTL_ADAPT_L` asks for it.
pub(super) fn inductance(
    params: &Params,
    p: &Si,
    scale: &Scale,
) -> Result<Option<Config>, BuildError> {
    if params.get(ParamId::CtlAdaptL) == 0.0 {
        return Ok(None);
    }
    let half_periods = (HALF_S / p.period_s) as u32;
    Ok(Some(Config {
        amplitude: scale.current_from_a(AMPLITUDE_SHARE * params.get(ParamId::LimPhaseA)),
        half_periods,
        mean_periods: (half_periods / 4).min(MEAN_PERIODS_MAX),
        gain: gain(
            ParamId::MotLUh,
            STEP * scale.flux_wb() / scale.current_a / p.inductance_h,
        )?,
    }))
}
