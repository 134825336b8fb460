//! An engine that interprets: the cross-check.
//!
//! The crate rsemu has the core with its exceptions, interrupt controller, SysTick and cycle counter.
//! `sleep` is this crate's, and `exceptions` puts right what the core leaves out of them: the IT state
//! and FPSCR in the frame, the fault of a frame that found no memory, the lock-up by a call to the
//! supervisor, bits that BASEPRI does not have. ICSR's VECTACTIVE reads as zero all the same.

mod exceptions;
mod sleep;
mod stage;

use std::any::Any;
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

use rsemu::core::space::{AddressSpace, Region};
use rsemu::cpu::arm::v7m::sys::Exception;
use rsemu::cpu::arm::v7m::{ArmV7m, Config};

use super::{Lines, Mapped, Processor, Register, Stop, Surroundings};
use crate::time::Cycles;
use sleep::Sleep;
use stage::{Bus, Scene, with};

/// Four bits of priority (RM0440, 14.1).
const PRIORITY_BITS: u8 = 4;

/// A Cortex-M4F, interpreted.
pub struct Interpreter<S> {
    core: ArmV7m,
    /// None while it runs: then it is on the stage.
    scene: Option<Scene>,
    lines: Lines,
    sleep: Option<Sleep>,
    /// The event register.
    event: bool,
    /// FPSCR of the context whose floating-point registers are still to be pushed.
    deferred: Option<u32>,
    locked_up: bool,
    /// What was pending at the last look that SEVONPEND asked for.
    pended: Vec<u32>,
    instructions: u64,
    surroundings: PhantomData<S>,
}

/// A core out of reset, on the bus.
fn core(vector_table: u32) -> ArmV7m {
    let config = Config::CORTEX_M4F
        .with_priority_bits(PRIORITY_BITS)
        .with_bit_band(false)
        .with_reset_vtor(vector_table);
    let core = ArmV7m::new(config);
    let space = AddressSpace::new("bus", 32);
    let all = Region::io("all", 1 << 32, Arc::new(Bus));
    space.topology().map(all, 0).expect("it fits");
    core.attach_space(Arc::new(space));
    core
}

impl<S: Surroundings + 'static> Processor<S> for Interpreter<S> {
    fn new(surroundings: S, memories: &[Mapped]) -> Self {
        Self {
            core: core(0),
            scene: Some(Scene::new(Box::new(surroundings), memories)),
            lines: Lines::default(),
            sleep: None,
            event: false,
            deferred: None,
            locked_up: false,
            pended: Vec::new(),
            instructions: 0,
            surroundings: PhantomData,
        }
    }

    fn reset(&mut self, vector_table: u32) {
        self.core = core(vector_table);
        self.lines = Lines::default();
        self.sleep = None;
        self.event = false;
        self.deferred = None;
        self.locked_up = false;
        self.pended.clear();
        if let Some(scene) = &mut self.scene {
            scene.reset();
        }
    }

    fn run(&mut self) -> Stop {
        stage::enter(self.scene.take().expect("it does not run"));
        let stop = loop {
            if let Some(stop) = self.step() {
                break stop;
            }
        };
        self.scene = stage::leave();
        stop
    }

    fn surroundings(&mut self) -> &mut S {
        let scene = self.scene.as_mut().expect("it does not run");
        let any: &mut dyn Any = scene.surroundings.as_mut();
        any.downcast_mut().expect("it was made with them")
    }

    fn register(&self, register: Register) -> u32 {
        let core = self.core.regs();
        match register {
            Register::R(number) => core.r[usize::from(number)],
            Register::Sp => core.r[13],
            Register::Lr => core.r[14],
            Register::Pc => core.r[15],
            Register::Xpsr => core.xpsr,
            Register::Msp => core.msp,
            Register::Psp => core.psp,
            Register::Primask => core.primask.into(),
            Register::Basepri => core.basepri.into(),
            Register::Control => core.control,
        }
    }

    fn set_register(&mut self, register: Register, value: u32) {
        let mut core = self.core.regs();
        match register {
            Register::R(number) => core.r[usize::from(number)] = value,
            Register::Sp => core.r[13] = value,
            Register::Lr => core.r[14] = value,
            Register::Pc => {
                self.sleep = None;
                core.r[15] = value & !1;
            }
            Register::Xpsr => core.xpsr = value,
            Register::Msp => core.msp = value,
            Register::Psp => core.psp = value,
            Register::Primask => core.primask = value & 1 != 0,
            Register::Basepri => core.basepri = value as u8,
            Register::Control => core.control = value,
        }
        self.core.set_regs(core);
    }

    fn instructions(&self) -> u64 {
        self.instructions
    }

    fn forget_code(&mut self, _: Range<u32>) {}
}

impl<S> Interpreter<S> {
    /// How many memories were written since a reset before they were read: the chip may not have taken the
    /// first write (ES0431).
    pub fn written_first(&self) -> u32 {
        self.scene.as_ref().map_or(0, |scene| scene.written_first)
    }

    fn step(&mut self) -> Option<Stop> {
        if with(|scene| scene.surroundings.asks_to_stop()) {
            return Some(Stop::Asked);
        }
        if self.locked_up || self.core.is_locked_up() {
            return Some(Stop::LockedUp);
        }
        self.follow_lines();
        if let Some(sleep) = self.sleep {
            if !self.wakes(sleep) {
                self.doze();
                return None;
            }
            self.sleep = None;
        }
        if self.core.reset_pending() || !self.hint() {
            self.execute()
        } else {
            None
        }
    }

    /// Gives the core the lines as they are. It sees none while its handler runs, and the non-maskable one
    /// always: there a rise makes it pending, and the level does not (B3.4.1).
    fn follow_lines(&mut self) {
        let in_handler = self.core.current_exception() == Exception::NMI;
        with(|scene| {
            let lines = scene.surroundings.lines();
            let mut changed = lines.interrupts ^ self.lines.interrupts;
            while changed != 0 {
                let position = changed.trailing_zeros();
                let up = lines.interrupts >> position & 1 != 0;
                self.core.set_irq(position as u16, up);
                if up {
                    self.rises(Exception(16 + position as u16));
                }
                changed &= changed - 1;
            }
            if lines.non_maskable && !self.lines.non_maskable {
                self.rises(Exception::NMI);
            }
            let mut pulses = lines.take_risen() & !lines.interrupts;
            while pulses != 0 {
                self.rises(Exception(16 + pulses.trailing_zeros() as u16));
                pulses &= pulses - 1;
            }
            self.lines.clone_from(lines);
            self.core.set_nmi(lines.non_maskable && !in_handler);
        });
    }

    /// The line of an exception rises, maybe in its handler.
    fn rises(&self, exception: Exception) {
        self.core
            .with_sys(|system| system.set_pending(exception, true));
    }

    /// The most urgent priority that is pending, with what the lines make pending now.
    fn pending(&self) -> Option<i32> {
        self.core.with_sys(|system| {
            let mut up = self.lines.interrupts;
            while up != 0 {
                let interrupt = Exception(16 + up.trailing_zeros() as u16);
                if !system.is_active(interrupt) {
                    system.set_pending(interrupt, true);
                }
                up &= up - 1;
            }
            if self.lines.non_maskable && !system.is_active(Exception::NMI) {
                system.set_pending(Exception::NMI, true);
            }
            system.highest_pending().map(|(_, priority)| priority)
        })
    }

    /// SysTick's time.
    fn tick(&self, cycles: Cycles) {
        self.core.with_sys(|system| {
            if system.tick_systick(cycles) && system.syst_csr & 2 != 0 {
                system.set_pending(Exception::SYSTICK, true);
            }
        });
    }

    /// Time in which the core does not execute, but is awake.
    fn spend(&self, cycles: Cycles) {
        self.tick(cycles);
        self.core.with_sys(|system| system.tick_cyccnt(cycles));
        with(|scene| scene.surroundings.pass(cycles));
    }

    /// Lets code in flash wait while that is busy.
    fn wait_for_flash(&self, pc: u32) {
        let wait = with(|scene| {
            let in_flash = scene.memory(pc, 2).is_some_and(|mapped| !mapped.writable);
            let until = scene.surroundings.flash_busy_until();
            let wait = until.saturating_sub(scene.surroundings.now());
            if in_flash { wait } else { 0 }
        });
        if wait > 0 {
            self.spend(wait);
        }
    }

    /// An exception's entry or an instruction.
    fn execute(&mut self) -> Option<Stop> {
        let (pc, state) = (self.core.pc(), self.core.xpsr());
        let float_state = self.core.fpscr();
        self.wait_for_flash(pc);
        with(Scene::begin);
        let cycles = self.core.step();
        let unmodelled = with(|scene| {
            self.instructions += u64::from(scene.fetched.is_some());
            scene.surroundings.pass(cycles);
            scene.unmodelled.take()
        });
        self.exception(state, float_state);
        self.trim_basepri();
        if let Some((address, written)) = unmodelled {
            return Some(Stop::Unmodelled {
                address,
                pc,
                written,
            });
        }
        if self.core.reset_requested() {
            self.core.clear_reset_request();
            return Some(Stop::Reset);
        }
        None
    }
}
