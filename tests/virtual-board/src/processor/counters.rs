//! SysTick and the cycle counter (ARMv7-M, B3.3 and C1.8), both counting the processor's clock.

use crate::time::{Cycles, NEVER};

/// SysTick: counts down from its reload value.
#[derive(Clone, Debug, Default)]
pub(super) struct SysTick {
    pub(super) reload: u32,
    /// Bits 0 to 2 of its control register.
    bits: u32,
    /// When it was, or will be, zero.
    zero: Cycles,
    /// The count at which it was stopped.
    stopped: u32,
    /// Whether it has reached zero since this was last read.
    flag: bool,
}

const ENABLED: u32 = 1;
const INTERRUPTS: u32 = 2;

impl SysTick {
    fn period(&self) -> Cycles {
        Cycles::from(self.reload) + 1
    }

    /// Returns when it next reaches zero.
    pub(super) fn due(&self) -> Cycles {
        if self.bits & ENABLED == 0 {
            NEVER
        } else {
            self.zero
        }
    }

    /// Reaches zero as often as due; returns whether that raises an interrupt.
    pub(super) fn act(&mut self, now: Cycles) -> bool {
        while self.due() <= now {
            self.flag = true;
            self.zero += self.period();
        }
        self.bits & INTERRUPTS != 0
    }

    pub(super) fn control(&mut self, now: Cycles) -> u32 {
        if self.due() <= now {
            self.act(now);
        }
        let flag = std::mem::take(&mut self.flag);
        self.bits | u32::from(flag) << 16
    }

    pub(super) fn set_control(&mut self, value: u32, now: Cycles) {
        let count = self.current(now);
        match (self.bits & ENABLED != 0, value & ENABLED != 0) {
            // From zero it starts with a reload.
            (false, true) if count == 0 => self.zero = now + self.period(),
            (false, true) => self.zero = now + Cycles::from(count),
            (true, false) => self.stopped = count,
            _ => {}
        }
        self.bits = value & 7;
    }

    pub(super) fn current(&self, now: Cycles) -> u32 {
        if self.bits & ENABLED == 0 {
            return self.stopped;
        }
        (self.zero.saturating_sub(now) % self.period()) as u32
    }

    /// Clears it to zero, from where it starts over; any write does so.
    pub(super) fn clear(&mut self, now: Cycles) {
        self.zero = now + self.period();
        self.stopped = 0;
        self.flag = false;
    }
}

/// DWT's cycle counter.
#[derive(Clone, Debug, Default)]
pub(super) struct CycleCounter {
    runs: bool,
    /// Its count minus the time while it runs; otherwise its count.
    offset: u32,
}

impl CycleCounter {
    pub(super) fn control(&self) -> u32 {
        // Four comparators.
        4 << 28 | u32::from(self.runs)
    }

    pub(super) fn set_control(&mut self, value: u32, now: Cycles) {
        let count = self.count(now);
        self.runs = value & 1 != 0;
        self.set(count, now);
    }

    pub(super) fn count(&self, now: Cycles) -> u32 {
        if self.runs {
            self.offset.wrapping_add(now as u32)
        } else {
            self.offset
        }
    }

    pub(super) fn set(&mut self, value: u32, now: Cycles) {
        self.offset = if self.runs {
            value.wrapping_sub(now as u32)
        } else {
            value
        };
    }
}
