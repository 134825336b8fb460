//! Exceptions, as the core has taken them: told, and with what it leaves out (DDI 0403, B1.5).

use rsemu::cpu::arm::v7m::sys::Exception;
use rsemu::cpu::arm::v7m::xpsr;

use super::super::HandlerEvent;
use super::stage::with;
use super::{Interpreter, PRIORITY_BITS};

/// EXC_RETURN's bit that says that the frame is on the process stack.
const ON_PROCESS_STACK: u32 = 1 << 2;

/// EXC_RETURN's bit that says that the frame has no floating-point registers.
const SHORT_FRAME: u32 = 1 << 4;

/// FPCCR.LSPACT.
const LAZY_ACTIVE: u32 = 1;

impl<S> Interpreter<S> {
    /// Looks whether the step was an exception's entry or return, or both.
    pub(super) fn exception(&mut self, state: u32, float_state: u32) {
        let before = Exception((state & xpsr::EXCEPTION) as u16);
        let after = self.core.current_exception();
        if before == Exception::THREAD && after == Exception::THREAD {
            return;
        }
        let entered = self.has_entered(after);
        if entered && after == Exception::HARD_FAULT && self.had_no_lower_priority(before) {
            self.locked_up = true;
            return;
        }
        let left = before != Exception::THREAD
            && (before == after && entered
                || before != after && !self.core.with_sys(|system| system.is_active(before)));
        self.settle_float_state(left);
        if left {
            self.report(before, false);
        }
        if entered {
            self.report(after, true);
            if !left {
                self.mend_frame(after, state);
                let deferred = self.core.with_sys(|system| system.fpccr & LAZY_ACTIVE != 0);
                if deferred && self.core.reg(14) & SHORT_FRAME == 0 {
                    self.deferred = Some(float_state);
                }
            }
        }
    }

    /// An entry is the step whose last read was of the vector that execution goes on at.
    fn has_entered(&self, exception: Exception) -> bool {
        let vector = self.core.vtor().wrapping_add(exception.vector_offset());
        exception != Exception::THREAD
            && self.core.reg(14) >= 0xffff_ffe0
            && with(|scene| {
                let memory = scene
                    .memory(vector, 4)
                    .filter(|_| scene.last_read == Some(vector));
                memory.is_some_and(|mapped| mapped.memory.read(vector, 4) & !1 == self.core.pc())
            })
    }

    /// Whether a hard fault could not be taken in this exception, or by FAULTMASK.
    fn had_no_lower_priority(&self, exception: Exception) -> bool {
        matches!(exception, Exception::NMI | Exception::HARD_FAULT) || self.core.regs().faultmask
    }

    fn report(&mut self, exception: Exception, entered: bool) {
        self.event = true;
        let instructions = self.instructions;
        with(|scene| {
            let passage = HandlerEvent {
                exception: exception.0,
                entered,
                instructions,
                since: scene.surroundings.now(),
            };
            scene.surroundings.exception(&passage);
        });
    }

    /// A deferred push has been made, or its context is back without it: the core had lost FPSCR.
    fn settle_float_state(&mut self, left: bool) {
        if self.deferred.is_none() {
            return;
        }
        let (active, registers) = self
            .core
            .with_sys(|system| (system.fpccr & LAZY_ACTIVE != 0, system.fpcar));
        let Some(float_state) = self.deferred.take_if(|_| !active) else {
            return;
        };
        if left {
            self.core.set_fpscr(float_state);
            return;
        }
        let place = registers.wrapping_add(64);
        with(|scene| {
            if let Some(mapped) = scene.memory(place, 4) {
                mapped.memory.write(place, 4, float_state);
            }
        });
    }

    /// Puts into the frame what the core leaves out of it; without memory for the frame, the exception waits
    /// and the hard fault comes first.
    fn mend_frame(&self, exception: Exception, state: u32) {
        let on_process_stack = self.core.reg(14) & ON_PROCESS_STACK != 0;
        let frame = if on_process_stack {
            self.core.psp()
        } else {
            self.core.msp()
        };
        let status = frame.wrapping_add(28);
        let lost = with(|scene| {
            let within_it = state & xpsr::IT_MASK;
            if let Some(mapped) = scene.memory(status, 4).filter(|_| within_it != 0) {
                let memory = &mapped.memory;
                memory.write(status, 4, memory.read(status, 4) | within_it);
            }
            scene.write_lost
        });
        if lost && exception.0 > Exception::HARD_FAULT.0 {
            self.core.with_sys(|system| {
                system.set_active(exception, false);
                system.set_pending(exception, true);
                system.set_pending(Exception::HARD_FAULT, true);
            });
        }
    }

    /// The core keeps bits of BASEPRI that a priority does not have.
    pub(super) fn trim_basepri(&self) {
        let mut registers = self.core.regs();
        let surplus = registers.basepri << PRIORITY_BITS >> PRIORITY_BITS;
        if surplus != 0 {
            registers.basepri -= surplus;
            self.core.set_regs(registers);
        }
    }
}
