//! The parameters in SI that several blocks need, and what is refused of them.

use core::cell::Cell;
use core::f32::consts::FRAC_PI_2;

use fixed::types::extra::Unsigned;
use siskin_params::choice::{CtlObsCure, CtlObserver};
use siskin_params::{Board, Choice, FromMotor, ParamId, Params};
use siskin_units::math::{Gain, Multiplier, Number, Real, gain_parts};
use siskin_units::{Scale, Voltage};

/// Why parameters do not make a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildError {
    /// The parameter to change.
    pub param: ParamId,
    /// The reason.
    pub reason: &'static str,
}

/// Electrical speed from which a phase may stay high, Hz: a driver of the first board's, which takes up to 0.2 mA, loses
/// 0.4 V of its 1.6 µF's in the third of a turn.
pub(super) const OVERMODULATION_HZ: f32 = 100.0;

/// The reason for refusing a PWM frequency: an observer needs four periods per turn, edges need twelve, six-step 24.
pub(super) const TOO_FEW_PERIODS: &str = "too few periods a turn at CTL_RPM_MAX";

/// Share of `LIM_PHASE_A` that a motor test may use.
pub(super) const TEST_SHARE: f32 = 0.2;

/// Speed at which (22) is linearised over `CTL_RPM_MAX`: 4500 rpm on the bench.
pub(super) const LINEARISED_SHARE: f32 = 0.75;

/// Share below which Run ends, of the speed at which it begins or of the least speed that can be commanded: the
/// hysteresis of the second paper's 3.2.4.
pub(super) const SLOW_SHARE: f32 = 0.5;

/// The reason for most refusals.
const OUT_OF_RANGE: &str = "makes a coefficient leave its range";

/// The source of the coefficients: the shared quantities in SI, the parameters, the board and the units.
pub(super) struct Si<'a> {
    pub(super) params: &'a Params,
    pub(super) board: &'a Board,
    pub(super) scale: Scale,
    /// The settings that may follow from the motor.
    pub(super) settings: FromMotor,
    /// R, Ω.
    pub(super) r: f32,
    /// L, H.
    pub(super) l: f32,
    /// φ, Wb.
    pub(super) flux: f32,
    /// J of the motor and its load, kg·m².
    pub(super) j: f32,
    /// R/L, 1/s.
    pub(super) r_over_l: f32,
    /// `LIM_PHASE_A`.
    pub(super) limit_a: f32,
    /// `LIM_BUS_V_MAX`.
    pub(super) supply_max_v: f32,
    /// `CTL_RPM_MAX`.
    pub(super) fastest_rpm: f32,
    /// The electrical speed at `CTL_RPM_MAX`.
    pub(super) fastest_rad_s: f32,
    /// The same in turns per period.
    pub(super) fastest_turns: f32,
    /// Speed below which Run ends and the flux is not followed.
    pub(super) slow_rpm: f32,
    /// The start's current, within `LIM_PHASE_A`.
    pub(super) start_a: f32,
    /// Bandwidth of the current loop: 1/ε of (20), (21).
    pub(super) current_rad_s: f32,
    /// Bandwidth of the speed loop: k_pω/J.
    pub(super) speed_rad_s: f32,
    /// Time for which both switches of a phase stay off at each change.
    pub(super) dead_time_s: f32,
    /// What the dead time takes of a phase's duty, including the diodes.
    pub(super) dead_share: f32,
    /// The control period T_s, s.
    pub(super) t: f32,
    /// Period of the outer loops, s.
    pub(super) outer_t: f32,
    /// p.
    pub(super) pole_pairs: f32,
    /// Unit of current, the scale's.
    pub(super) unit_a: f32,
    /// Unit of voltage, the scale's.
    pub(super) unit_v: f32,
    /// Unit of flux.
    pub(super) unit_wb: f32,
    /// Unit of charge.
    pub(super) unit_as: f32,
    /// Unit of mechanical speed.
    pub(super) unit_rad_s: f32,
    /// Unit of electrical speed, rad/s.
    pub(super) rad_per_unit: f32,
    /// Turns a resistance in Ω into a gain from current to voltage.
    pub(super) voltage_per_current: f32,
    /// Turns J·1/s into a gain from speed to torque.
    pub(super) torque_per_speed: f32,
    /// The first refusal. Recorded here rather than returned: on the chip, a hundred early returns take more flash than
    /// the coefficients that they guard.
    pub(super) refused: Cell<Option<BuildError>>,
}

impl Si<'_> {
    pub(super) fn get(&self, id: ParamId) -> f32 {
        self.params.get(id)
    }

    pub(super) fn choice<C: Choice>(&self) -> C {
        self.params.choice()
    }

    pub(super) fn chosen<C: Choice>(&self, choice: C) -> bool {
        self.params.chosen(choice)
    }

    /// Returns true if the observer is helped where there is little back-EMF. The first paper's stays as published, and
    /// sensors give the position at any speed.
    pub(super) fn is_helped(&self) -> bool {
        let published = self.chosen(CtlObserver::BackEmf) && self.chosen(CtlObsCure::Published);
        !published && !self.chosen(CtlObserver::Hall)
    }

    /// Converts a time to whole periods.
    pub(super) fn periods(&self, time_s: f32) -> u32 {
        (time_s / self.t) as u32
    }

    /// Converts volts to a voltage, saturated.
    pub(super) fn voltage(&self, volts: f32) -> Voltage {
        Voltage::from_f32(volts / self.unit_v)
    }

    /// Returns a coefficient as a gain; if it has none, refuses the parameter.
    pub(super) fn gain<A: Number, B: Number>(&self, param: ParamId, value: f32) -> Gain<A, B> {
        let (mantissa, shift) = self.parts(param, value, B::Frac::I32 - A::Frac::I32);
        Gain::from_parts(mantissa, shift)
    }

    /// Returns a coefficient as a factor; if it is out of range, refuses the parameter.
    pub(super) fn factor<A: Number, B: Number>(
        &self,
        param: ParamId,
        value: f32,
    ) -> Multiplier<A, B> {
        Multiplier::from_bits(self.bits(param, value, B::Frac::I32 - A::Frac::I32))
    }

    /// Returns the [`Gain::from_parts`] of `value·2^exponent`. Never inlined: every gain calls it.
    #[inline(never)]
    fn parts(&self, param: ParamId, value: f32, exponent: i32) -> (i32, u32) {
        let parts = gain_parts(value, exponent);
        self.refuse_if(parts.is_none(), param, OUT_OF_RANGE);
        parts.unwrap_or_default()
    }

    /// Returns the bits of a factor, a gain without a shift. Never inlined: every factor calls it.
    #[inline(never)]
    fn bits(&self, param: ParamId, value: f32, exponent: i32) -> i32 {
        let (mantissa, shift) = self.parts(param, value, exponent);
        let fits = shift == 0;
        self.refuse_if(!fits, param, OUT_OF_RANGE);
        if fits { mantissa } else { 0 }
    }

    /// Refuses a parameter if `value` exceeds `limit`.
    #[inline(never)] // else each of many callers would compare
    pub(super) fn refuse_above(
        &self,
        value: f32,
        limit: f32,
        param: ParamId,
        reason: &'static str,
    ) {
        self.refuse_if(value > limit, param, reason);
    }

    /// Refuses a parameter if `refused`, unless another was refused before. Never inlined: every coefficient may call
    /// it.
    #[inline(never)]
    pub(super) fn refuse_if(&self, refused: bool, param: ParamId, reason: &'static str) {
        if refused && self.refused.get().is_none() {
            self.refused.set(Some(BuildError { param, reason }));
        }
    }

    /// Returns the first refusal, if any.
    pub(super) fn verdict(&self) -> Result<(), BuildError> {
        self.refused.get().map_or(Ok(()), Err)
    }
}

/// Returns the control's units in SI for these parameters.
pub fn scale(params: &Params, board: &Board) -> Scale {
    scale_of(&params.in_force(), board)
}

/// Like [`scale`], for parameters in force.
#[inline(never)] // the coefficients call it too
pub(super) fn scale_of(params: &Params, board: &Board) -> Scale {
    let flux_wb = params.get(ParamId::MotFluxMwb) * 1e-3;
    let period_s = 1.0 / params.get(ParamId::PwmFreqHz);
    Scale {
        period_s,
        current_a: board.current_a_per_count * 4096.0 / 3.0,
        voltage_v: FRAC_PI_2 * flux_wb / period_s,
        pole_pairs: params.get(ParamId::MotPolePairs),
    }
}

#[cfg(test)]
mod tests {
    use fixed::types::I16F16;
    use siskin_params::BOSSO_BENCH;

    use super::*;
    use crate::drive::Drift;

    /// Returns what a test's coefficients refuse first.
    fn refused(test: impl FnOnce(&Si)) -> Option<BuildError> {
        let params = Params::of(&BOSSO_BENCH);
        let p = Si::new(&params, &Board::BENCH, Drift::NONE);
        test(&p);
        p.refused.get()
    }

    #[test]
    fn a_coefficient_within_its_range_refuses_nothing() {
        let refused = refused(|p| {
            let gain: Gain<I16F16, I16F16> = p.gain(ParamId::MotRMohm, 1e3);
            assert!((gain.apply(I16F16::ONE) - I16F16::lit("1000")).abs() < 0.001);
            let factor: Multiplier<I16F16, I16F16> = p.factor(ParamId::MotLUh, 0.25);
            assert_eq!(factor.of(I16F16::ONE), I16F16::lit("0.25"));
        });
        assert_eq!(refused, None);
    }

    #[test]
    fn the_first_parameter_is_refused_whose_coefficient_does_not_fit() {
        let refused = refused(|p| {
            let _: Gain<I16F16, I16F16> = p.gain(ParamId::MotLUh, 1e3);
            let _: Multiplier<I16F16, I16F16> = p.factor(ParamId::MotRMohm, 1e3);
            let _: Gain<I16F16, I16F16> = p.gain(ParamId::CtlFfA, 1e30);
        });
        let wanted = (ParamId::MotRMohm, OUT_OF_RANGE);
        assert_eq!(
            refused.map(|error| (error.param, error.reason)),
            Some(wanted)
        );
    }

    #[test]
    fn the_first_parameter_is_refused_that_is_above_its_limit() {
        let refused = refused(|p| {
            p.refuse_above(0.02, 0.02, ParamId::MotLUh, "it is not above");
            p.refuse_above(0.03, 0.02, ParamId::MotRMohm, "above 20 mΩ");
            p.refuse_above(1.0, 0.0, ParamId::CtlFfA, "it is not the first");
        });
        let wanted = (ParamId::MotRMohm, "above 20 mΩ");
        assert_eq!(
            refused.map(|error| (error.param, error.reason)),
            Some(wanted)
        );
    }
}
