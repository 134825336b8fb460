//! The parameters that several blocks need, in SI, and what is refused of them.

use core::cell::Cell;
use core::f32::consts::FRAC_PI_2;

use super::quantity::Quantity;
use crate::params::board::Board;
use crate::params::table::{Choice, ParamId};
use crate::params::values::Params;
use crate::units::Scale;

/// The reason why parameters do not make a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildError {
    /// The parameter to change.
    pub param: ParamId,
    /// The reason.
    pub reason: &'static str,
}

/// The reason to refuse a PWM: an observer needs four periods a turn, edges need twelve, six-step 24.
pub(super) const TOO_FEW_PERIODS: &str = "too few periods a turn at CTL_RPM_MAX";

/// Share of `LIM_PHASE_A` that a test of the motor may use.
pub(super) const TEST_SHARE: f32 = 0.2;

/// Speed at which (22) is linearised, of `CTL_RPM_MAX`: 4500 rpm on the bench.
pub(super) const LINEARISED_SHARE: f32 = 0.75;

/// Share below which Run ends, of the speed at which it begins or of the least that can be asked
/// for: the hysteresis of the second paper's 3.2.4.
pub(super) const SLOW_SHARE: f32 = 0.5;

/// The reason for most refusals.
pub(super) const OUT_OF_RANGE: &str = "makes a coefficient leave its range";

/// The source of the coefficients: the parameters that several blocks need in SI, and all else that
/// there is.
pub(super) struct Si<'a> {
    pub(super) params: &'a Params,
    pub(super) board: &'a Board,
    pub(super) scale: Scale,
    /// What formulas are made of.
    pub(super) quantities: &'a [Cell<f32>; Quantity::COUNT],
    /// Those that are to be worked out next.
    pub(super) formulas: Cell<&'static [u8]>,
    /// The first that was refused. Noted here and not returned: on the chip, a hundred early returns
    /// take more flash than the coefficients that they guard.
    pub(super) refused: &'a Cell<Option<BuildError>>,
}

impl<'a> Si<'a> {
    /// Room for the quantities.
    pub(super) fn quantities() -> [Cell<f32>; Quantity::COUNT] {
        [const { Cell::new(0.0) }; Quantity::COUNT]
    }

    /// Of parameters that are [in force](Params::in_force).
    pub(super) fn new(
        params: &'a Params,
        board: &'a Board,
        quantities: &'a [Cell<f32>; Quantity::COUNT],
        refused: &'a Cell<Option<BuildError>>,
    ) -> Self {
        Self {
            params,
            board,
            scale: scale_of(params, board),
            quantities,
            formulas: Cell::new(&[]),
            refused,
        }
    }

    /// The value of a quantity.
    pub(super) fn of(&self, quantity: Quantity) -> f32 {
        self.quantities[usize::from(quantity.0)].get()
    }

    /// Gives a quantity its value.
    pub(super) fn set(&self, quantity: Quantity, value: f32) {
        self.quantities[usize::from(quantity.0)].set(value);
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
        (time_s / self.of(Quantity::T)) as u32
    }

    /// Refuses a parameter where one value is above another.
    #[inline(never)] // the comparison would be at each of many
    pub(super) fn refuse_above(
        &self,
        value: f32,
        limit: f32,
        param: ParamId,
        reason: &'static str,
    ) {
        self.refuse_if(value > limit, param, reason);
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
#[inline(never)] // the coefficients ask for it too
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
