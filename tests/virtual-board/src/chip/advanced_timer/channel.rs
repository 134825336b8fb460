//! A channel's comparison and its reference output.

use stm32_metapac::timer::vals::Ocm;

use super::ramp::Ramp;
use crate::time::{Cycles, NEVER};

/// One channel.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    mode: Ocm,
    /// Whether writes wait for an update.
    preloaded: bool,
    written: u16,
    compare: u16,
    /// The last result of the comparison.
    below: bool,
    reference: bool,
}

impl Channel {
    /// Creates it as after a reset.
    pub(super) const fn new() -> Self {
        Self {
            mode: Ocm::FROZEN,
            preloaded: false,
            written: 0,
            compare: 0,
            below: false,
            reference: false,
        }
    }

    /// Returns whether this mode is modelled.
    pub(super) fn has(mode: Ocm) -> bool {
        pwm(mode) || matches!(mode, Ocm::FROZEN | Ocm::FORCE_ACTIVE | Ocm::FORCE_INACTIVE)
    }

    /// Returns the reference output.
    pub(super) fn reference(&self) -> bool {
        self.reference
    }

    /// Returns the compare register as written.
    pub(super) fn written(&self) -> u16 {
        self.written
    }

    /// Returns the value compared with.
    pub(super) fn compare(&self) -> u16 {
        self.compare
    }

    /// Sets whether writes to the compare register wait for an update.
    pub(super) fn set_preloaded(&mut self, preloaded: bool) {
        self.preloaded = preloaded;
        self.write(self.written);
    }

    /// Writes the compare register.
    pub(super) fn write(&mut self, value: u16) {
        self.written = value;
        if !self.preloaded {
            self.compare = value;
        }
    }

    /// Takes the compare register at an update.
    pub(super) fn update(&mut self) {
        self.compare = self.written;
    }

    /// Changes the mode. Between the PWM modes the reference stays until the comparison's result changes;
    /// from any other mode it follows at once (RM0440, TIM1_CCMR1.OC1M).
    pub(super) fn set_mode(&mut self, mode: Ocm) {
        let before = std::mem::replace(&mut self.mode, mode);
        match mode {
            Ocm::FORCE_ACTIVE => self.reference = true,
            Ocm::FORCE_INACTIVE => self.reference = false,
            _ if pwm(mode) && !pwm(before) => self.follow(),
            _ => {}
        }
    }

    fn follow(&mut self) {
        self.reference = self.below == (self.mode == Ocm::PWM_MODE1);
    }

    /// Compares with the counter; returns whether the result has changed.
    pub(super) fn look(&mut self, ramp: &Ramp, now: Cycles) -> bool {
        let (elapsed, compare) = (ramp.elapsed(now), Cycles::from(self.compare));
        let below = if ramp.down() {
            elapsed + compare >= ramp.top()
        } else {
            elapsed < compare
        };
        let changes = below != self.below;
        if changes {
            self.below = below;
            if pwm(self.mode) {
                self.follow();
            }
        }
        changes
    }

    /// Returns when the comparison's result changes next, before the counter turns.
    pub(super) fn due(&self, ramp: &Ramp) -> Cycles {
        let compare = Cycles::from(self.compare);
        match ramp.turned_at() {
            Some(_) if self.below == ramp.down() => NEVER,
            Some(at) if ramp.down() && compare > 0 => at + ramp.top().saturating_sub(compare),
            Some(at) if !ramp.down() && compare < ramp.top() => at + compare,
            _ => NEVER,
        }
    }
}

fn pwm(mode: Ocm) -> bool {
    matches!(mode, Ocm::PWM_MODE1 | Ocm::PWM_MODE2)
}
