//! The coefficients of the start.

use fixed::types::I36F28;

use super::{BuildError, Si, gain};
use crate::control::start;
use crate::params::{ParamId, Params};
use crate::units::Scale;

/// Damping ζ of the rotor's swing about the current's vector in Park and Ramp.
const SWING_DAMPING: f32 = 0.5;

/// Rate at which the frame yields, over the swing's ω_n: fast against it, slow against noise.
const YIELD_RATE_SHARE: f32 = 5.0;

/// What a test of the motor may use of `LIM_PHASE_A`.
const TEST_SHARE: f32 = 0.2;

/// Section 3.2 of the second paper.
pub(super) fn start(params: &Params, p: &Si, scale: &Scale) -> Result<start::Config, BuildError> {
    let current_a = params
        .get(ParamId::StaRampA)
        .min(params.get(ParamId::LimPhaseA));
    let current = scale.current_from_a(current_a);
    let park_charge = params.get(ParamId::StaParkAs) / (scale.current_a * p.period_s);
    // A quarter of a turn in the first half of the charge.
    let sweep = 0.25 / (0.5 * park_charge);
    let step = params.get(ParamId::StaRampRpmS) * p.period_s * p.pole_pairs * p.period_s / 60.0;
    // The rotor about the current's vector is a pendulum of ω_n² = 1.5·p²·φ·I/J; yielding by
    // 2ζ/ω_n a unit of speed damps it by ζ.
    let stiffness = 1.5 * p.pole_pairs * p.pole_pairs * p.flux_wb * current_a;
    let swing_rad_s = libm::sqrtf(stiffness / p.inertia_kgm2);
    let yielding_s = 2.0 * SWING_DAMPING / swing_rad_s;
    Ok(start::Config {
        current,
        test_current: scale.current_from_a(TEST_SHARE * params.get(ParamId::LimPhaseA)),
        yielding: gain(ParamId::MotJGcm2, yielding_s / p.period_s)?,
        yield_rate: gain(
            ParamId::MotJGcm2,
            (YIELD_RATE_SHARE * swing_rad_s * p.period_s).min(1.0),
        )?,
        park_charge: I36F28::saturating_from_num(park_charge),
        sweep: gain(ParamId::StaParkAs, sweep)?,
        k_s: gain(
            ParamId::StaRampRpmS,
            step * scale.current_a / params.get(ParamId::StaRampA),
        )?,
        run_speed: scale.speed_from_rpm(params.get(ParamId::StaRunRpm)),
    })
}
