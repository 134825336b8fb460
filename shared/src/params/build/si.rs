//! The parameters in SI that several blocks need, and what is refused of them.

use core::cell::Cell;
use core::f32::consts::FRAC_PI_2;

use super::quantity::Quantity;
use crate::params::board::Board;
use crate::params::choice::{CtlObsCure, CtlObserver};
use crate::params::table::{Choice, ParamId};
use crate::params::values::Params;
use crate::units::Scale;

/// Why parameters do not make a drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildError {
    /// The parameter to change.
    pub param: ParamId,
    /// The reason.
    pub reason: &'static str,
}

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
pub(super) const OUT_OF_RANGE: &str = "makes a coefficient leave its range";

/// The source of the coefficients: the shared quantities in SI, the parameters, the board and the units.
pub(super) struct Si<'a> {
    pub(super) params: &'a Params,
    pub(super) board: &'a Board,
    pub(super) scale: Scale,
    /// The quantities that formulas are made of.
    pub(super) quantities: &'a [Cell<f32>; Quantity::COUNT],
    /// The formulas to be evaluated next.
    pub(super) formulas: Cell<&'static [u8]>,
    /// The first refusal. Recorded here rather than returned: on the chip, a hundred early returns take more flash than
    /// the coefficients that they guard.
    pub(super) refused: &'a Cell<Option<BuildError>>,
}

impl<'a> Si<'a> {
    /// Creates room for the quantities.
    pub(super) fn quantities() -> [Cell<f32>; Quantity::COUNT] {
        [const { Cell::new(0.0) }; Quantity::COUNT]
    }

    /// Takes parameters that are [in force](Params::in_force).
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

    /// Returns the value of a quantity.
    pub(super) fn of(&self, quantity: Quantity) -> f32 {
        self.quantities[usize::from(quantity.0)].get()
    }

    /// Sets the value of a quantity.
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

    /// Returns true if the observer is helped where there is little back-EMF. The first paper's stays as published, and
    /// sensors give the position at any speed.
    pub(super) fn is_helped(&self) -> bool {
        let published = self.chosen(CtlObserver::BackEmf) && self.chosen(CtlObsCure::Published);
        !published && !self.chosen(CtlObserver::Hall)
    }

    /// Converts a time to whole periods.
    pub(super) fn periods(&self, time_s: f32) -> u32 {
        (time_s / self.of(Quantity::T)) as u32
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
