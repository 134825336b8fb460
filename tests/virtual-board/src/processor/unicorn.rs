//! The engine that translates the image's code: QEMU's, through the crate `unicorn-engine`.
//!
//! It executes instructions; what makes it a Cortex-M is here and in `exceptions` and `private`. Time is
//! counted at the start of each code block: there an exception is taken, and there a run stops. A register
//! is accessed at the time of its instruction.

mod hooks;
mod registers;

use std::ops::Range;

use unicorn_engine::{
    Arch, ArmCpuModel, HookType, MemType, Mode, Prot, RegisterARM, Unicorn, uc_error,
};

use hooks::{
    ADDRESS_VALID, FETCH, FORCED, PRECISE, STACKING, block, doze, fault, interrupt, invalid, load,
    store,
};
use registers::{float_name, name, read, read_number, write};

use super::cost::Costs;
use super::exceptions::State;
use super::priority::{Exceptions, Masks, PRIORITY_MASK, bit, number};
use super::private::Private;
use super::{Access, HandlerEvent, Mapped, Register, Stop, Surroundings};
use crate::time::Cycles;

/// Where the chip's registers are, and the store, which is accessed like them.
const REGISTERS: [Range<u64>; 4] = [
    0x0801_f000..0x0802_0000,
    0x1fff_0000..0x2000_0000,
    0x4000_0000..0x6000_0000,
    0xe000_0000..0xe010_0000,
];

/// A Cortex-M4F in its surroundings, run by that engine.
pub struct Processor<S: Surroundings + 'static> {
    engine: Unicorn<'static, Inside<S>>,
}

/// What the engine's hooks work on.
struct Inside<S> {
    surroundings: S,
    private: Private,
    memories: Vec<Mapped>,
    costs: Costs,
    /// When the latest block began.
    began: Cycles,
    /// The block being executed.
    running: Option<Running>,
    instructions: u64,
    /// The first access to each watched memory.
    watched: Vec<Option<Access>>,
    /// The event register.
    event: bool,
    asleep: Option<Sleep>,
    stop: Option<Stop>,
}

#[derive(Clone, Copy)]
struct Running {
    address: u32,
    number: usize,
    cycles: u64,
    /// Those that have already been counted.
    spent: u64,
}

#[derive(Clone, Copy, PartialEq)]
enum Sleep {
    Interrupt,
    Event,
}

impl<S: Surroundings> Inside<S> {
    /// Completes the block that was being executed: its time has passed.
    fn settle(&mut self) {
        if let Some(running) = self.running.take() {
            let block = self.costs.block(running.number);
            self.instructions += u64::from(block.instructions);
            self.event |= block.sends_event;
            self.surroundings
                .pass(running.cycles.saturating_sub(running.spent));
        }
    }

    /// Advances to the time of an instruction in the block.
    fn reach(&mut self, pc: u32) {
        if let Some(running) = &mut self.running {
            let block = self.costs.block(running.number);
            let before = u64::from(block.before(pc.wrapping_sub(running.address)));
            let ahead = before.saturating_sub(running.spent);
            running.spent += ahead;
            self.surroundings.pass(ahead);
        }
    }

    /// Samples what has come up by now.
    fn latch(&mut self) {
        self.private.exceptions.latch(self.surroundings.lines());
        if self.private.sys_tick.due() <= self.surroundings.now() {
            self.tick();
        }
    }

    #[cold]
    fn tick(&mut self) {
        if self.private.sys_tick.act(self.surroundings.now()) {
            self.private.exceptions.pending |= bit(number::SYS_TICK);
        }
    }

    /// Lets time pass until the next event, or `until`.
    fn wait(&mut self, until: Cycles) {
        let next = self.surroundings.next().min(self.private.sys_tick.due());
        let now = self.surroundings.now();
        self.surroundings
            .pass(next.min(until).saturating_sub(now).max(1));
        self.latch();
    }

    fn memory(&self, address: u32, bytes: u32) -> Option<&Mapped> {
        let mut memories = self.memories.iter();
        memories.find(|mapped| mapped.memory.holds(address, bytes))
    }
}

impl<S: Surroundings + 'static> State for Unicorn<'_, Inside<S>> {
    fn get(&self, register: Register) -> u32 {
        read(self, name(register))
    }

    fn set(&mut self, register: Register, value: u32) {
        write(self, name(register), value);
        if register == Register::Xpsr {
            // The engine keeps what it derives from the state until the flags are written.
            write(self, RegisterARM::APSR_NZCV, value);
        }
    }

    fn float(&self, index: u32) -> u32 {
        read_number(self, float_name(index))
    }

    fn set_float(&mut self, index: u32, value: u32) {
        // The engine has all registers requested here.
        let _ = self.reg_write(float_name(index), value.into());
    }

    fn load(&self, address: u32) -> Option<u32> {
        let mapped = self.get_data().memory(address, 4)?;
        Some(mapped.memory.read(address, 4))
    }

    fn store(&mut self, address: u32, value: u32) -> bool {
        let mapped = self.get_data().memory(address, 4);
        let mapped = mapped.filter(|mapped| mapped.writable);
        if let Some(mapped) = mapped {
            mapped.memory.write(address, 4, value);
        }
        mapped.is_some()
    }

    fn exceptions(&mut self) -> &mut Exceptions {
        let inside = self.get_data_mut();
        inside.latch();
        &mut inside.private.exceptions
    }

    fn vector_table(&self) -> u32 {
        self.get_data().private.vtor
    }

    fn clear_faultmask(&mut self) {
        write(self, RegisterARM::FAULTMASK, 0);
    }

    fn masks(&self) -> Masks {
        Masks {
            primask: read(self, RegisterARM::PRIMASK) & 1 != 0,
            faultmask: read(self, RegisterARM::FAULTMASK) & 1 != 0,
            basepri: read(self, RegisterARM::BASEPRI) as u8 & PRIORITY_MASK,
        }
    }

    fn note(&mut self, exception: u16, entered: bool) {
        let inside = self.get_data_mut();
        inside.event = true;
        let passage = HandlerEvent {
            exception,
            entered,
            instructions: inside.instructions,
            since: inside.began,
        };
        inside.surroundings.exception(&passage);
    }

    fn spend(&mut self, cycles: u64) {
        self.get_data_mut().surroundings.pass(cycles);
    }

    fn stacking_fault(&mut self) -> u16 {
        let private = &mut self.get_data_mut().private;
        private.cfsr |= STACKING;
        private.hfsr |= FORCED;
        number::HARD_FAULT
    }
}

impl<S: Surroundings + 'static> Processor<S> {
    /// Creates one at power-up, with this plain memory.
    ///
    /// # Panics
    /// If the engine cannot be created for lack of memory.
    pub fn new(surroundings: S, memories: &[Mapped]) -> Self {
        let inside = Inside {
            surroundings,
            private: Private::new(),
            memories: memories.to_vec(),
            costs: Costs::new(),
            began: 0,
            running: None,
            instructions: 0,
            watched: Vec::new(),
            event: false,
            asleep: None,
            stop: None,
        };
        // Thumb mode only: adding the M-class mode would turn any model into a Cortex-M33.
        let engine = Unicorn::new_with_data(Arch::ARM, Mode::THUMB, inside);
        let engine = engine.expect("the engine is linked");
        let mut processor = Self { engine };
        processor.open().expect("regions that do not overlap");
        let model = processor.engine.ctl_get_cpu_model();
        assert_eq!(model, Ok(ArmCpuModel::CORTEX_M4 as i32));
        processor
    }

    /// Starts from the vector table at this address.
    pub fn reset(&mut self, vector_table: u32) {
        let engine = &mut self.engine;
        let inside = engine.get_data_mut();
        inside.settle();
        inside.private = Private::new();
        inside.private.vtor = vector_table;
        inside.event = false;
        inside.asleep = None;
        inside.stop = None;
        for register in [
            RegisterARM::PRIMASK,
            RegisterARM::BASEPRI,
            RegisterARM::FAULTMASK,
        ] {
            write(engine, register, 0);
        }
        engine.set(Register::Xpsr, 1 << 24);
        engine.set(Register::Control, 0);
        engine.set(Register::Lr, u32::MAX);
        let stack = engine.load(vector_table).unwrap_or(0);
        let start = engine.load(vector_table + 4).unwrap_or(0);
        engine.set(Register::Sp, stack & !3);
        engine.set(Register::Pc, start | 1);
    }

    /// Runs until something stops it; a later call continues from there.
    pub fn run(&mut self) -> Stop {
        loop {
            if self.engine.get_data().asleep.is_some() {
                doze(&mut self.engine);
            }
            if let Some(stop) = self.engine.get_data_mut().stop.take() {
                return stop;
            }
            self.execute();
        }
    }

    /// Returns its surroundings.
    pub fn surroundings(&mut self) -> &mut S {
        &mut self.engine.get_data_mut().surroundings
    }

    /// Reads a register, while it does not run.
    pub fn register(&self, register: Register) -> u32 {
        self.engine.get(register)
    }

    /// Writes a register, while it does not run, as a debugger does. Writing the program counter wakes a
    /// sleeping processor.
    pub fn set_register(&mut self, register: Register, value: u32) {
        let value = if register == Register::Pc {
            self.engine.get_data_mut().asleep = None;
            value | 1
        } else {
            value
        };
        self.engine.set(register, value);
    }

    /// Returns the instructions executed since power-up.
    pub fn instructions(&self) -> u64 {
        self.engine.get_data().instructions
    }

    /// Records the first access to each of these memories, from now on. This slows the engine down.
    pub fn watch(&mut self, memories: &[Range<u32>]) {
        self.engine.get_data_mut().watched = vec![None; memories.len()];
        for (number, memory) in memories.iter().enumerate() {
            let accesses = HookType::MEM_READ | HookType::MEM_WRITE;
            let note = move |engine: &mut Unicorn<'_, Inside<S>>, kind, _, _, _| {
                let access = match kind {
                    MemType::WRITE => Access::Write,
                    _ => Access::Read,
                };
                engine.get_data_mut().watched[number].get_or_insert(access);
                true
            };
            let (start, end) = (u64::from(memory.start), u64::from(memory.end));
            let hook = self.engine.add_mem_hook(accesses, start, end - 1, note);
            hook.expect("the engine takes hooks at any time");
        }
    }

    /// Returns the first access to each watched memory.
    pub fn first_accesses(&self) -> &[Option<Access>] {
        &self.engine.get_data().watched
    }

    /// Notes that memory that may hold code has changed other than by the program's writes.
    pub fn forget_code(&mut self, addresses: Range<u32>) {
        self.engine.get_data_mut().costs.forget();
        let Range { start, end } = addresses;
        // If nothing was translated, there is nothing to forget.
        let _ = self.engine.ctl_remove_cache(start.into(), end.into());
    }
}

impl<S: Surroundings + 'static> Processor<S> {
    /// Lets the engine execute until it stops.
    fn execute(&mut self) {
        let engine = &mut self.engine;
        let pc = read(engine, RegisterARM::PC) | 1;
        let result = engine.emu_start(pc.into(), 1, 0, 0);
        engine.get_data_mut().settle();
        if engine.get_data().stop.is_some() {
            return;
        }
        let pc = read(engine, RegisterARM::PC) & !1;
        match result {
            // The only other end of a run is an instruction that waits for an interrupt.
            Ok(()) => engine.get_data_mut().asleep = Some(Sleep::Interrupt),
            Err(uc_error::READ_UNMAPPED | uc_error::WRITE_UNMAPPED | uc_error::WRITE_PROT) => {
                fault(engine, number::BUS_FAULT, PRECISE | ADDRESS_VALID, pc);
            }
            Err(uc_error::FETCH_UNMAPPED) => fault(engine, number::BUS_FAULT, FETCH, pc),
            Err(_) => engine.get_data_mut().stop = Some(Stop::Undefined { pc }),
        }
    }

    fn open(&mut self) -> Result<(), uc_error> {
        let engine = &mut self.engine;
        // First of all: this rebuilds the engine's state for the model.
        engine.ctl_set_cpu_model(ArmCpuModel::CORTEX_M4 as i32)?;
        let memories = engine.get_data().memories.clone();
        for mapped in &memories {
            let cells = mapped.memory.cells();
            let prot = if mapped.writable {
                Prot::ALL
            } else {
                Prot::READ | Prot::EXEC
            };
            let start = u64::from(mapped.memory.range().start);
            // SAFETY: the engine reads and writes bytes that may change behind a shared reference (cells),
            // on this thread; `Inside` holds the memory for as long as the engine lives.
            unsafe {
                engine.mem_map_ptr(start, cells.len() as u64, prot, cells.as_ptr() as *mut _)?;
            }
        }
        let is_memory = |address: u64| {
            let mut memories = memories.iter();
            memories.any(|mapped| mapped.memory.holds(address as u32, 1))
        };
        // On another chip, the store's addresses are plain memory.
        for registers in REGISTERS.into_iter().filter(|each| !is_memory(each.start)) {
            let Range { start, end } = registers;
            engine.mmio_map(
                start,
                end - start,
                Some(move |engine: &mut Unicorn<'_, Inside<S>>, offset, bytes| {
                    load(engine, (start + offset) as u32, bytes)
                }),
                Some(
                    move |engine: &mut Unicorn<'_, Inside<S>>, offset, bytes, value| {
                        let address = (start + offset) as u32;
                        store(engine, address, bytes, value as u32);
                    },
                ),
            )?;
            // It does nothing, but with a hook the engine's program counter is that of the access.
            let accesses = HookType::MEM_READ | HookType::MEM_WRITE;
            engine.add_mem_hook(accesses, start, end - 1, |_, _: MemType, _, _, _| true)?;
        }
        engine.add_block_hook(1, 0, |engine, address, bytes| {
            block(engine, address, bytes);
        })?;
        let nowhere = HookType::MEM_UNMAPPED | HookType::MEM_PROT;
        engine.add_mem_hook(nowhere, 1, 0, |engine, _, address, _, _| {
            engine.get_data_mut().private.fault_address = address as u32;
            // The access fails.
            false
        })?;
        engine.add_intr_hook(|engine, kind| interrupt(engine, kind))?;
        engine.add_insn_invalid_hook(|engine| invalid(engine))?;
        Ok(())
    }
}
