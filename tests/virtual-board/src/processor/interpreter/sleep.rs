//! Sleep (DDI 0403, B1.5.18 and B1.5.19): the core's own would wake for interrupts that are masked, and
//! knows no event but SEV.

use rsemu::cpu::arm::v7m::xpsr;

use super::Interpreter;
use super::stage::with;
use crate::time::Cycles;

/// The longest sleep without a look at what may end it: 1 ms.
const NAP: Cycles = 170_000;

/// SCR.SEVONPEND.
const SEVONPEND: u32 = 1 << 4;

/// Hints that concern sleep, by their encoding.
const WFE: u32 = 0xbf20;
const WFI: u32 = 0xbf30;
const SEV: u32 = 0xbf40;

/// What it sleeps for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sleep {
    /// WFI.
    Interrupt,
    /// WFE.
    Event,
}

impl<S> Interpreter<S> {
    /// Executes the next instruction here if it is one that sleeps.
    pub(super) fn hint(&mut self) -> bool {
        let (pc, state) = (self.core.pc(), self.core.xpsr());
        let code = with(|scene| Some(scene.memory(pc, 2)?.memory.read(pc, 2)));
        let sleep = match code {
            Some(WFI) => Sleep::Interrupt,
            Some(WFE) => Sleep::Event,
            Some(SEV) => {
                self.event = true;
                return false;
            }
            _ => return false,
        };
        let pending = self.pending();
        let taken = pending.is_some_and(|priority| priority < self.core.execution_priority());
        if taken || state & xpsr::IT_MASK != 0 {
            return false;
        }
        self.core.set_pc(pc.wrapping_add(2));
        self.instructions += 1;
        if !self.wakes(sleep) {
            self.sleep = Some(sleep);
        }
        self.spend(1);
        true
    }

    pub(super) fn wakes(&mut self, sleep: Sleep) -> bool {
        let pending = self.pending();
        self.look_for_event();
        let below = |limit| pending.is_some_and(|priority| priority < limit);
        match sleep {
            Sleep::Interrupt => below(self.priority_without_primask()),
            Sleep::Event => {
                std::mem::take(&mut self.event) || below(self.core.execution_priority())
            }
        }
    }

    /// The priority of what it executes, but for PRIMASK: WFI does not look at that.
    fn priority_without_primask(&self) -> i32 {
        let registers = self.core.regs();
        let (active, mask) = self
            .core
            .with_sys(|system| (system.active_priority(), system.group_mask()));
        let base = match registers.basepri & mask {
            0 => i32::MAX,
            base => i32::from(base),
        };
        let fault = if registers.faultmask { -1 } else { i32::MAX };
        active.min(base).min(fault)
    }

    /// With SEVONPEND, what has become pending is an event, enabled or not.
    fn look_for_event(&mut self) {
        let (pending, asked) = self
            .core
            .with_sys(|system| (system.pending.to_vec(), system.scr & SEVONPEND != 0));
        if asked {
            let before = self.pended.iter().chain(std::iter::repeat(&0));
            self.event |= pending
                .iter()
                .zip(before)
                .any(|(now, then)| now & !then != 0);
        }
        self.pended = pending;
    }

    /// Lets time pass asleep, until something may happen. SysTick counts on, the cycle counter does not.
    pub(super) fn doze(&mut self) {
        let tick = self.core.with_sys(|system| match system.syst_csr & 3 {
            3 if system.syst_cvr == 0 => Cycles::from(system.syst_rvr) + 1,
            3 => Cycles::from(system.syst_cvr),
            _ => NAP,
        });
        with(|scene| {
            let here = &mut scene.surroundings;
            let free = here.next().saturating_sub(here.now());
            let cycles = free.min(tick).clamp(1, NAP);
            here.pass(cycles);
            self.tick(cycles);
        });
    }
}
