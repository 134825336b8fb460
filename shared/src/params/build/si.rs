//! The parameters that several blocks need, in SI, and what is refused of them.

use core::cell::Cell;
use core::f32::consts::{FRAC_PI_2, TAU};

use fixed::types::extra::Unsigned;

use crate::math::{Gain, Multiplier, Number, Real, gain_parts};
use crate::params::board::Board;
use crate::params::from_motor::FromMotor;
use crate::params::table::{Choice, ParamId};
use crate::params::values::Params;
use crate::units::{Scale, Speed, Voltage};

/// The reason why parameters do not make a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildError {
    /// The parameter to change.
    pub param: ParamId,
    /// The reason.
    pub reason: &'static str,
}

/// Share of `LIM_PHASE_A` that a test of the motor may use.
pub(super) const TEST_SHARE: f32 = 0.2;

/// Speed at which (22) is linearised, of `CTL_RPM_MAX`: 4500 rpm on the bench.
pub(super) const LINEARISED_SHARE: f32 = 0.75;

/// Share below which Run ends, of the speed at which it begins or of the least that can be asked
/// for: the hysteresis of the second paper's 3.2.4.
pub(super) const SLOW_SHARE: f32 = 0.5;

/// The reason for most refusals.
const OUT_OF_RANGE: &str = "makes a coefficient leave its range";

/// The source of the coefficients: the parameters that several blocks need in SI, and all else that
/// there is.
pub(super) struct Si<'a> {
    pub(super) params: &'a Params,
    /// Which of them follow from the motor.
    pub(super) from_motor: FromMotor,
    pub(super) board: &'a Board,
    pub(super) scale: Scale,
    pub(super) period_s: f32,
    pub(super) dead_time_s: f32,
    pub(super) pole_pairs: f32,
    pub(super) resistance_ohm: f32,
    pub(super) inductance_h: f32,
    pub(super) flux_wb: f32,
    pub(super) inertia_kgm2: f32,
    /// Bandwidth of the current loop, 1/s: 1/ε of (20), (21).
    pub(super) current_rad_s: f32,
    /// Bandwidth of the speed loop, 1/s: k_pω/J.
    pub(super) speed_rad_s: f32,
    /// Electrical speed at which (22) is linearised, 1/s.
    pub(super) linearised_rad_s: f32,
    /// The first that was refused. Noted here and not returned: on the chip, a hundred early returns
    /// take more flash than the coefficients that they guard.
    pub(super) refused: &'a Cell<Option<BuildError>>,
}

impl<'a> Si<'a> {
    /// Of parameters that are [in force](Params::in_force).
    pub(super) fn new(
        params: &'a Params,
        board: &'a Board,
        refused: &'a Cell<Option<BuildError>>,
    ) -> Self {
        let scale = scale_of(params, board);
        let Scale {
            period_s,
            pole_pairs,
            ..
        } = scale;
        let from_motor = FromMotor::new(params);
        let rpm = LINEARISED_SHARE * params.get(ParamId::CtlRpmMax);
        Self {
            params,
            from_motor,
            board,
            scale,
            period_s,
            dead_time_s: params.get(ParamId::PwmDeadtimeNs) * 1e-9,
            pole_pairs,
            resistance_ohm: params.get(ParamId::MotRMohm) * 1e-3,
            inductance_h: params.get(ParamId::MotLUh) * 1e-6,
            flux_wb: params.get(ParamId::MotFluxMwb) * 1e-3,
            inertia_kgm2: params.get(ParamId::MotJGcm2) * 1e-7,
            current_rad_s: TAU * from_motor.current_hz,
            speed_rad_s: TAU * from_motor.speed_hz,
            linearised_rad_s: rpm * pole_pairs * TAU / 60.0,
            refused,
        }
    }

    pub(super) fn get(&self, id: ParamId) -> f32 {
        self.params.get(id)
    }

    pub(super) fn choice<C: Choice>(&self) -> C {
        self.params.choice()
    }

    pub(super) fn chosen<C: Choice>(&self, choice: C) -> bool {
        self.params.chosen(choice)
    }

    /// A time in whole periods.
    pub(super) fn periods(&self, time_s: f32) -> u32 {
        (time_s / self.period_s) as u32
    }

    /// Below this speed Run ends, and the flux is not followed, rpm.
    pub(super) fn slow_rpm(&self) -> f32 {
        SLOW_SHARE * self.from_motor.run_rpm.min(self.from_motor.least_rpm)
    }

    /// As [`Self::slow_rpm`].
    pub(super) fn slow(&self) -> Speed {
        self.scale.speed_from_rpm(self.slow_rpm())
    }

    /// A volt number in the control's unit. Never inlined: each limit in volts is one.
    #[inline(never)]
    pub(super) fn voltage(&self, volts: f32) -> Voltage {
        Voltage::from_f32(volts / self.scale.voltage_v)
    }

    /// The gain of value `k`; if there is none, the parameter is refused.
    pub(super) fn gain<A: Number, B: Number>(&self, param: ParamId, k: f32) -> Gain<A, B> {
        let (mantissa, shift) = self.gain_parts(param, k, B::Frac::I32 - A::Frac::I32);
        Gain::from_parts(mantissa, shift)
    }

    /// The factor of value `k`; if it leaves its type's range, the parameter is refused.
    pub(super) fn factor<A: Number, B: Number>(&self, param: ParamId, k: f32) -> Multiplier<A, B> {
        Multiplier::from_bits(self.factor_bits(param, k, B::Frac::I32 - A::Frac::I32))
    }

    pub(super) fn factor_bits(&self, param: ParamId, k: f32, exponent: i32) -> i32 {
        let (bits, shift) = self.gain_parts(param, k, exponent);
        self.refuse_if(shift != 0, param, OUT_OF_RANGE);
        bits
    }

    pub(super) fn gain_parts(&self, param: ParamId, k: f32, exponent: i32) -> (i32, u32) {
        let parts = gain_parts(k, exponent);
        self.refuse_if(parts.is_none(), param, OUT_OF_RANGE);
        parts.unwrap_or((0, 0))
    }

    /// Refuses a parameter in some case, unless another has been refused before. Never inlined: each
    /// coefficient may be one.
    #[inline(never)]
    pub(super) fn refuse_if(&self, refused: bool, param: ParamId, reason: &'static str) {
        if refused && self.refused.get().is_none() {
            self.refused.set(Some(BuildError { param, reason }));
        }
    }

    /// The first refusal, if any.
    pub(super) fn verdict(&self) -> Result<(), BuildError> {
        self.refused.get().map_or(Ok(()), Err)
    }
}

/// The control's units in SI with these parameters.
pub fn scale(params: &Params, board: &Board) -> Scale {
    scale_of(&params.in_force(), board)
}

/// As [`scale`], of what is in force.
fn scale_of(params: &Params, board: &Board) -> Scale {
    let flux_wb = params.get(ParamId::MotFluxMwb) * 1e-3;
    let period_s = 1.0 / params.get(ParamId::PwmFreqHz);
    Scale {
        period_s,
        current_a: board.current_a_per_count * 4096.0 / 3.0,
        voltage_v: FRAC_PI_2 * flux_wb / period_s,
        pole_pairs: params.get(ParamId::MotPolePairs),
    }
}
