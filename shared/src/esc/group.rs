//! Several ESCs in one program: who tells of whom.

use super::Esc;
use crate::mavlink::Four;

impl Esc {
    /// The number of its motor in the vehicle, from 0, if its component id numbers it.
    pub fn number(&self) -> Option<u8> {
        self.component.number()
    }

    /// Leaves the messages for four ESCs to another one, which tells of this one.
    pub fn follow(&mut self) {
        self.component.follow();
    }

    /// Has the part in a group that another had: the same ESC before a restart.
    pub fn regroup(&mut self, before: &Self) {
        self.four = before.four;
        if before.component.follows() {
            self.follow();
        }
    }

    /// Tells of the other ESCs of its messages for four besides, as these are now.
    pub fn lead(&mut self, four: Four) {
        self.four = Some(four);
    }
}
