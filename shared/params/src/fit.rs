//! What a board cannot do: such a value is refused, and a stored one brought within the bounds at the start.

use super::board::{Board, PwmBound};
use super::choice::CtlDrive;
use super::table::ParamId;
use super::values::Params;

impl Params {
    /// Returns the factory's values on a board.
    pub fn factory(board: &Board) -> Self {
        let mut params = Self::default();
        params.fit(board);
        params
    }

    /// Raises a dead time below the board's least, and lowers a supply's limit above its greatest. Returns the last of them
    /// that somebody has chosen, and why it is changed.
    pub fn fit(&mut self, board: &Board) -> Option<(ParamId, &'static str)> {
        let (least, supply) = (board.least_dead_time, board.greatest_supply);
        let dead_time = self.hold(ParamId::PwmDeadtimeNs, (least.ns, f32::MAX), least.refusal);
        let supply = self.hold(ParamId::LimBusVMax, (0.0, supply.value), supply.refusal);
        supply.or(dead_time)
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
    pub fn pwm_bound(&self, board: &Board) -> Option<&'static PwmBound> {
        let six_step = self.drives_by_six_step();
        board.pwm_bounds.iter().find(|bound| {
            let (id, value) = bound.choice;
            match id {
                ParamId::CtlDrive => six_step == (value == CtlDrive::SixStep.setting().1),
                // A choice that this build lacks is kept, and another is in force.
                _ => !six_step && self.get(id) == value && !id.lacks(value),
            }
        })
    }
}

impl ParamId {
    /// Returns why a board refuses this value, whatever the others are; its own range is not looked at.
    pub fn beyond(self, value: f32, board: &Board) -> Option<&'static str> {
        let number = value as u8;
        let (is_beyond, refusal) = match self {
            Self::LimPhaseA => (
                value > board.greatest_phase.value,
                board.greatest_phase.refusal,
            ),
            Self::LimBusVMax => (
                value > board.greatest_supply.value,
                board.greatest_supply.refusal,
            ),
            Self::PwmDeadtimeNs => (
                value < board.least_dead_time.ns,
                board.least_dead_time.refusal,
            ),
            Self::InpProto => (
                !matches!(number, 0..=4 | 10..=13 | 20..=23),
                "neither 0, 1 to 4, 10 to 13 nor 20 to 23",
            ),
            _ => (false, ""),
        };
        is_beyond.then_some(refusal)
    }
}
