//! What a board cannot do with stored parameters is brought within its bounds at the start.

use super::board::{Board, PwmBound};
use super::table::ParamId;
use super::values::Params;

impl Params {
    /// Raises a dead time below the board's least, and lowers a supply's limit above its greatest and a PWM frequency above
    /// the bound of what is in force. Returns the last of them that somebody has chosen, and why it is changed.
    pub fn fit(&mut self, board: &Board) -> Option<(ParamId, &'static str)> {
        let (least, supply) = (board.least_dead_time, board.greatest_supply);
        let dead_time = self.hold(ParamId::PwmDeadtimeNs, (least.ns, f32::MAX), least.refusal);
        let supply = self.hold(ParamId::LimBusVMax, (0.0, supply.value), supply.refusal);
        let pwm = self
            .pwm_bound(board)
            .and_then(|bound| self.hold(ParamId::PwmFreqHz, (0.0, bound.hz), bound.refusal));
        pwm.or(supply).or(dead_time)
    }

    /// Holds a value within bounds; returns the reason if that changes one that somebody has chosen.
    fn hold(
        &mut self,
        id: ParamId,
        (least, greatest): (f32, f32),
        refusal: &'static str,
    ) -> Option<(ParamId, &'static str)> {
        let before = self.get(id);
        let chosen = !self.is_default(id);
        let held = before.max(least).min(greatest);
        self.assume(id, held);
        (chosen && held != before).then_some((id, refusal))
    }

    /// Returns the bound of `PWM_FREQ_HZ` for the choices in force, if there is one.
    pub(super) fn pwm_bound(&self, board: &Board) -> Option<&'static PwmBound> {
        let six_step = self.drives_by_six_step();
        board.pwm_bounds.iter().find(|bound| {
            let (id, value) = bound.choice;
            match id {
                ParamId::CtlDrive => six_step,
                // A choice that this build lacks is kept, and another is in force.
                _ => !six_step && self.get(id) == value && !id.lacks(value),
            }
        })
    }
}
