//! Which exception is taken when: the interrupt controller's state (ARMv7-M, B1.5 and B3.4).

use super::Lines;

/// Exceptions by number.
pub(super) mod number {
    pub(crate) const NMI: u16 = 2;
    pub(crate) const HARD_FAULT: u16 = 3;
    pub(crate) const MEMORY_FAULT: u16 = 4;
    pub(crate) const BUS_FAULT: u16 = 5;
    pub(crate) const USAGE_FAULT: u16 = 6;
    pub(crate) const SV_CALL: u16 = 11;
    pub(crate) const PEND_SV: u16 = 14;
    pub(crate) const SYS_TICK: u16 = 15;
    /// The first interrupt.
    pub(crate) const INTERRUPTS: u16 = 16;
}

use number::{HARD_FAULT, INTERRUPTS, NMI};

/// Possible exceptions: the system's and 102 interrupts (RM0440, table 97), rounded up to a word.
const EXCEPTIONS: usize = 16 + 112;

/// Priority bits that the chip implements: the upper four.
pub(super) const PRIORITY_MASK: u8 = 0xf0;

/// Priority when no exception is active: below all.
pub(super) const NONE: i16 = 256;

/// The processor's masks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Masks {
    pub(super) primask: bool,
    pub(super) faultmask: bool,
    pub(super) basepri: u8,
}

/// Pending, enabled and active exceptions, one bit each, by number.
#[derive(Clone, Debug)]
pub(super) struct Exceptions {
    pub(super) enabled: u128,
    pub(super) pending: u128,
    pub(super) active: u128,
    priorities: [u8; EXCEPTIONS],
    /// The lines when last looked at.
    lines: u128,
}

impl Exceptions {
    pub(super) fn new() -> Self {
        Self {
            // NMI, HardFault, SVCall, PendSV and SysTick cannot be disabled.
            enabled: bit(NMI) | bit(HARD_FAULT) | bit(11) | bit(14) | bit(15),
            pending: 0,
            active: 0,
            priorities: [0; EXCEPTIONS],
            lines: 0,
        }
    }

    /// Samples the lines: one that is up makes its interrupt pending unless that is being handled; one that
    /// rises does so in any case.
    pub(super) fn latch(&mut self, lines: &Lines) {
        let risen = lines.take_risen() << INTERRUPTS;
        let lines = lines.interrupts << INTERRUPTS | u128::from(lines.non_maskable) << NMI;
        if lines | risen != 0 {
            self.pending |= risen | lines & !(self.active & self.lines);
        }
        self.lines = lines;
    }

    /// Returns whether any enabled exception is pending, masked or not.
    pub(super) fn any(&self) -> bool {
        self.pending & self.enabled != 0
    }

    pub(super) fn priority(&self, exception: u16) -> i16 {
        match exception {
            NMI => -2,
            HARD_FAULT => -1,
            _ => i16::from(self.priorities[usize::from(exception)]),
        }
    }

    /// Returns the priority as in the register.
    pub(super) fn priority_bits(&self, exception: u16) -> u8 {
        let priority = self.priorities.get(usize::from(exception));
        priority.copied().unwrap_or(0)
    }

    pub(super) fn set_priority_bits(&mut self, exception: u16, bits: u8) {
        if let Some(priority) = self.priorities.get_mut(usize::from(exception)) {
            *priority = bits & PRIORITY_MASK;
        }
    }

    /// Returns the highest priority among the active exceptions.
    pub(super) fn active_priority(&self) -> i16 {
        self.first(self.active)
            .map_or(NONE, |(_, priority)| priority)
    }

    /// Returns the current execution priority.
    pub(super) fn execution_priority(&self, masks: Masks) -> i16 {
        let mut priority = self.active_priority();
        if masks.basepri != 0 {
            priority = priority.min(i16::from(masks.basepri));
        }
        if masks.primask {
            priority = priority.min(0);
        }
        if masks.faultmask {
            priority = priority.min(-1);
        }
        priority
    }

    /// Returns the exception to be taken now.
    pub(super) fn due(&self, masks: Masks) -> Option<u16> {
        let (exception, priority) = self.highest()?;
        (priority < self.execution_priority(masks)).then_some(exception)
    }

    /// Returns the pending exception of the highest priority, masked or not.
    pub(super) fn highest(&self) -> Option<(u16, i16)> {
        self.first(self.pending & self.enabled)
    }

    /// Notes that an exception is entered.
    pub(super) fn enter(&mut self, exception: u16) {
        self.pending &= !bit(exception);
        self.active |= bit(exception);
    }

    /// Notes that an exception has been handled; its line may still be up.
    pub(super) fn leave(&mut self, exception: u16) {
        self.active &= !bit(exception);
        self.pending |= self.lines & bit(exception);
    }

    /// Returns the one with the highest priority, or the lowest number among equals.
    fn first(&self, mut of: u128) -> Option<(u16, i16)> {
        let mut best: Option<(u16, i16)> = None;
        while of != 0 {
            let exception = of.trailing_zeros() as u16;
            of &= of - 1;
            let priority = self.priority(exception);
            if best.is_none_or(|(_, other)| priority < other) {
                best = Some((exception, priority));
            }
        }
        best
    }
}

/// Returns an exception's bit.
pub(super) const fn bit(exception: u16) -> u128 {
    1 << exception
}
