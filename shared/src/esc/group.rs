//! Several ESCs in one program: which one reports for which.

use super::Esc;
use crate::mavlink::Four;

impl Esc {
    /// Returns the motor's number in the vehicle, from 0, if the component id implies one.
    pub fn number(&self) -> Option<u8> {
        self.component.number()
    }

    /// Leaves the messages for four ESCs to another one, which reports this one.
    pub fn follow(&mut self) {
        self.component.follow();
    }

    /// Takes over the group role of the same ESC before a restart.
    pub fn regroup(&mut self, before: &Self) {
        self.four = before.four;
        if before.component.follows() {
            self.follow();
        }
    }

    /// Includes the other ESCs, in their current state, in the messages for four.
    pub fn lead(&mut self, four: Four) {
        self.four = Some(four);
    }
}
