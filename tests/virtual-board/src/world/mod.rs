//! Chip and bench together, as the surroundings of the processor.
//!
//! Time moves from one event to the next: a part of the chip that is due, an edge on the throttle wire.
//! What parts tell each other goes through `signals`; the bench follows the gates edge by edge, and is read
//! where a converter samples (`analog`).

mod analog;
mod signals;

use siskin_emulator::machine::Stopped;
use siskin_emulator::plant::Gate;
use siskin_emulator::surroundings::{Passage, Surroundings as Bench};

use crate::bridge::Bridge;
use crate::chip::comparator::Defect;
use crate::chip::flash::Flash;
use crate::chip::parts::Parts;
use crate::chip::rcc::Supply;
use crate::chip::{Cause, Context, Part, STORE, Signal, UNIQUE_ID};
use crate::load::Load;
use crate::memory::Memory;
use crate::processor::{BusError, HandlerEvent, Lines, Surroundings, Width};
use crate::throttle::{Reply, Throttle};
use crate::time::{CLOCK_HZ, Cycles};
use analog::Coupling;

/// The end-of-conversion interrupt, by its position in the vector table.
const CONVERTED: u16 = 18;

/// The first exception that is an interrupt.
const INTERRUPTS: u16 = 16;

/// Reserved up to the SRAM (RM0440, table 3): where a stack that leaves its memory ends up.
const RESERVED: std::ops::Range<u32> = 0x1fff_8000..0x2000_0000;

/// The comparators' registers.
const COMPARATORS: std::ops::Range<u32> = 0x4001_0200..0x4001_0300;

/// The processor's clock after a reset: the internal oscillator.
const RESET_HZ: u64 = 16_000_000;

/// The chip's unique id, in the form of a real one: the bytes of its text.
const ID: [u32; 3] = [0x5156_0001, 0x3143_5307, 0x2038_3153];

/// Events for onlookers.
#[derive(Clone, Debug)]
pub enum Event {
    /// A PWM period that began at a time, s.
    Passage(f64, Passage),
    /// A leg's gates changed.
    Gates(Cycles, usize, Gate),
    /// The throttle wire's level changed, whoever drove it.
    Edge(Cycles, bool),
    /// The chip has replied on the throttle wire.
    Reply(Reply),
    /// A serial line, by number, has sent a byte.
    Byte(Cycles, u8, u8),
}

/// The chip on its bench.
pub struct World {
    now: Cycles,
    /// When something next happens by itself.
    next: Cycles,
    /// When the run stops.
    pub(crate) until: Cycles,
    /// The processor's cycle, in eighths of a 170 MHz cycle, and the eighths left over.
    eighths: u64,
    rest: u64,
    lines: Lines,
    parts: Parts,
    memories: Vec<Memory>,
    signals: Vec<Signal>,
    coupling: Coupling,
    pub(crate) throttle: Throttle,
    pub(crate) happened: Vec<Event>,
    /// Why the chip was reset, if it was.
    pub(crate) reset: Option<Cause>,
    /// Why the run cannot continue.
    pub(crate) failed: Option<Stopped>,
    /// Figures for the PWM interrupt.
    pub load: Load,
    /// Where the image keeps its set-point word, if known.
    setpoint_at: Option<u32>,
    /// Looks at the start and end of each control period.
    probe: Option<Probe>,
    /// How many times as long as it should the control interrupt takes.
    slowness: u64,
}

/// Called at the start and end of each control period.
type Probe = Box<dyn FnMut(Moment, &Probed)>;

/// A moment of the control interrupt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// It is entered.
    Entered,
    /// It has returned.
    Left,
}

/// What a probe may look at.
pub struct Probed<'a> {
    /// The chip's parts.
    pub parts: &'a Parts,
    /// SRAM and CCM.
    pub memories: &'a [Memory],
    /// The time.
    pub now: Cycles,
}

impl Probed<'_> {
    /// Returns bytes from memory.
    pub fn bytes(&self, address: u32, count: u32) -> Option<Vec<u8>> {
        let mut memories = self.memories.iter();
        let memory = memories.find(|memory| memory.holds(address, count))?;
        Some(memory.bytes(address, count as usize))
    }

    /// Returns what the converters' injected sequences have read, by rank.
    pub fn injected(&self) -> [[u16; 4]; 2] {
        self.parts.converters.injected()
    }

    /// Returns the levels at port B's pins.
    pub fn port_b(&self) -> u32 {
        self.parts.ports[1].input()
    }

    /// Returns TIM1's compare values of the legs, as written.
    pub fn compares(&self) -> [u16; 3] {
        self.parts.tim1.compares()
    }

    /// Returns whether TIM1's break has turned the bridge off (BIF), and whether the main output is on
    /// (MOE).
    pub fn broken_and_on(&self) -> (bool, bool) {
        self.parts.tim1.broken_and_on()
    }
}

impl World {
    /// Creates a chip with this flash and these memories on its bench, at power-up.
    pub fn new(
        flash: Flash,
        memories: Vec<Memory>,
        bench: Bench,
        setpoint_at: Option<u32>,
    ) -> Self {
        let mut world = Self {
            now: 0,
            next: 0,
            until: 0,
            eighths: 8 * CLOCK_HZ / RESET_HZ,
            rest: 0,
            lines: Lines::default(),
            parts: Parts::new(flash),
            memories,
            signals: Vec::new(),
            coupling: Coupling::new(bench),
            throttle: Throttle::default(),
            happened: Vec::new(),
            reset: None,
            failed: None,
            load: Load::default(),
            setpoint_at,
            probe: None,
            slowness: 1,
        };
        world.forget_memory();
        world.settle();
        world
    }

    /// Lets a closure look at each control period.
    pub fn probe(&mut self, probe: impl FnMut(Moment, &Probed) + 'static) {
        self.probe = Some(Box::new(probe));
    }

    /// Resets the chip: its gates turn off, and everything except flash, RAM and the reset cause is as at
    /// power-up.
    pub fn restart(&mut self, cause: Cause) {
        let mut context = Context {
            now: self.now,
            signals: &mut self.signals,
        };
        self.parts.reset(cause, &mut context);
        self.signals.clear();
        self.lines = Lines::default();
        self.eighths = 8 * CLOCK_HZ / RESET_HZ;
        self.gates_off();
        self.throttle.drive(self.now, None);
        self.settle();
    }

    /// Loses the memories' contents, which become random.
    pub fn forget_memory(&mut self) {
        let mut state = 1_u32;
        for cell in self.memories.iter().flat_map(Memory::cells) {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            cell.set((state >> 24) as u8);
        }
    }

    /// Halts the processor for good, as a debugger does.
    pub fn halt(&mut self) {
        if self.parts.debug.stops_tim1() {
            let mut context = Context {
                now: self.now,
                signals: &mut self.signals,
            };
            self.parts.tim1.halt(&mut context);
            self.settle();
        }
    }

    /// Notes that the processor has locked up.
    pub fn lock_up(&mut self) {
        if self.parts.syscfg.lock_up_breaks() {
            let mut context = Context {
                now: self.now,
                signals: &mut self.signals,
            };
            self.parts.tim1.set_break(true, &mut context);
            self.settle();
        }
    }

    /// Returns the chip's parts.
    pub fn parts(&mut self) -> &mut Parts {
        &mut self.parts
    }

    /// Gives one of the board's comparators, by number, a defect.
    pub fn set_comparator_defect(&mut self, number: u8, defect: Defect) {
        self.parts.comparators.set_defect(number, defect);
    }

    /// Makes the control interrupt's code cost this many times as many cycles from now on.
    pub fn slow_control(&mut self, times: u64) {
        self.slowness = times;
    }

    /// Sets the option bytes.
    pub fn set_options(&mut self, options: u32) {
        self.parts.flash.options = options;
    }

    /// Cuts the supply of a leg's high-side driver, which never turns on from then on.
    pub fn open_gate_supply(&mut self, leg: usize) {
        self.coupling.unsupplied[leg] = true;
    }

    /// Damages the thermistor, which shows this from then on, °C: at absolute zero it does not conduct.
    pub fn damage_thermistor(&mut self, shown_c: f64) {
        self.coupling.sensor_c = Some(shown_c);
    }

    /// Shifts the three shunts' grounds above the chip's, V, as other currents do on a board.
    pub fn shift_grounds(&mut self, grounds_v: [f64; 3]) {
        self.coupling.grounds_v = grounds_v;
    }

    /// Returns what the converters' injected sequences last read, by rank.
    pub fn injected(&self) -> [[u16; 4]; 2] {
        self.parts.converters.injected()
    }

    /// Makes the converters err as described at [`Converters::mislead`].
    ///
    /// [`Converters::mislead`]: crate::chip::adc::Converters::mislead
    pub fn mislead_converters(&mut self) {
        self.parts.converters.mislead();
    }

    /// Returns the flash.
    pub fn flash(&mut self) -> &mut Flash {
        &mut self.parts.flash
    }

    /// Returns SRAM and CCM.
    pub fn memories(&self) -> &[Memory] {
        &self.memories
    }

    /// Returns the bench.
    pub fn bench(&mut self) -> &mut Bench {
        &mut self.coupling.bench
    }

    /// Returns the independent check of the gates.
    pub fn bridge(&self) -> &Bridge {
        &self.coupling.bridge
    }

    /// Returns when a comparator last began to request a break, if one ever did.
    pub fn tripped(&self) -> Option<Cycles> {
        self.coupling.tripped
    }

    /// Receives bytes on MAVLink's line.
    pub fn serial(&mut self, bytes: &[u8]) {
        self.parts.usart2.queue(bytes, self.now);
        self.settle();
    }

    /// Notes that edges were added to the throttle wire.
    pub fn edges_come(&mut self) {
        self.settle();
    }

    /// Lets time pass without a processor.
    pub fn idle(&mut self, until: Cycles) {
        while self.now < until && self.reset.is_none() {
            let next = self.next.min(until);
            self.go(next);
        }
    }

    /// Advances to a time, with everything that happens until then.
    fn go(&mut self, target: Cycles) {
        while self.next <= target {
            self.now = self.now.max(self.next);
            let mut context = Context {
                now: self.now,
                signals: &mut self.signals,
            };
            self.parts.act(&mut context);
            if self.throttle.due() <= self.now {
                self.edge();
            }
            if self.coupling.due() <= self.now {
                self.end_period();
            }
            self.settle();
        }
        self.now = self.now.max(target);
    }

    /// Handles the parts' signals, and finds what happens next.
    fn settle(&mut self) {
        self.deal();
        let of_bench = self.coupling.due();
        self.next = self.parts.due().min(self.throttle.due()).min(of_bench);
    }

    /// Updates the processor's clock, which may have changed.
    fn reclock(&mut self) {
        let supply = Supply {
            boost: self.parts.pwr.boost(),
            wait_states: self.parts.flash.wait_states(),
        };
        match self.parts.rcc.clock_hz(supply) {
            Ok(hz) => self.eighths = (8 * CLOCK_HZ).div_ceil(hz.max(1)),
            Err(error) => self.fail(&error),
        }
        self.parts.rcc.open_backup(self.parts.pwr.backup_open());
    }

    fn fail(&mut self, error: &dyn std::fmt::Display) {
        let at_ms = 1e3 * crate::time::seconds(self.now);
        let stopped = || Stopped(format!("the chip at {at_ms:.3} ms: {error}"));
        self.failed.get_or_insert_with(stopped);
    }

    fn access<T>(
        &mut self,
        address: u32,
        access: impl FnOnce(&mut dyn Part, u32, &mut Context) -> Result<T, crate::chip::Unmodelled>,
    ) -> Result<T, BusError> {
        if self.parts.at(address).is_some() && !self.parts.rcc.has_clock(address) {
            self.fail(&format_args!(
                "a register at {address:#010x}, whose part has no clock (RCC's enable registers), is used"
            ));
            return Err(BusError::Unmodelled);
        }
        let mut context = Context {
            now: self.now,
            signals: &mut self.signals,
        };
        let (part, offset) = self.parts.at(address).ok_or(BusError::Unmodelled)?;
        access(part, offset & !3, &mut context).map_err(|_| BusError::Unmodelled)
    }
}

impl Surroundings for World {
    fn now(&self) -> Cycles {
        self.now
    }

    fn read(&mut self, address: u32, width: Width) -> Result<u32, BusError> {
        if RESERVED.contains(&address) {
            return Err(BusError::Nothing);
        }
        let shift = 8 * (address & 3);
        let value = if STORE.contains(&address) {
            let mut context = Context {
                now: self.now,
                signals: &mut self.signals,
            };
            let value = self.parts.flash.array_read(address, width, &mut context);
            self.settle();
            return value.map_err(|_| BusError::Unmodelled);
        } else if UNIQUE_ID.contains(&address) {
            ID[((address - UNIQUE_ID.start) / 4) as usize]
        } else {
            if COMPARATORS.contains(&address) {
                self.look();
            }
            let value = self.access(address, |part, offset, context| part.read(offset, context))?;
            self.settle();
            value
        };
        Ok(match width {
            Width::Byte => value >> shift & 0xff,
            Width::Half => value >> shift & 0xffff,
            Width::Word => value,
        })
    }

    fn write(&mut self, address: u32, width: Width, value: u32) -> Result<(), BusError> {
        if RESERVED.contains(&address) {
            return Err(BusError::Nothing);
        }
        if address & 3 != 0 {
            return Err(BusError::Unmodelled);
        }
        if STORE.contains(&address) {
            let mut context = Context {
                now: self.now,
                signals: &mut self.signals,
            };
            let written = self
                .parts
                .flash
                .array_write(address, width, value, &mut context);
            self.settle();
            return written.map_err(|_| BusError::Unmodelled);
        }
        self.access(address, |part, offset, context| {
            part.write(offset, value, context)
        })?;
        // RCC, the flash's wait states and the core's supply.
        if matches!(address >> 12, 0x4_0021 | 0x4_0022 | 0x4_0007) {
            self.reclock();
        }
        self.offer_requests();
        self.settle();
        Ok(())
    }

    fn pass(&mut self, cycles: Cycles) {
        let times = if self.load.is_in_interrupt() {
            self.slowness
        } else {
            1
        };
        let cycles = cycles * times;
        let eighths = cycles * self.eighths + self.rest;
        self.rest = eighths % 8;
        let target = self.now + eighths / 8;
        if self.next <= target {
            self.go(target);
        } else {
            self.now = target;
        }
    }

    fn next(&self) -> Cycles {
        self.next.min(self.until)
    }

    fn lines(&self) -> &Lines {
        &self.lines
    }

    fn asks_to_stop(&self) -> bool {
        self.now >= self.until || self.reset.is_some() || self.failed.is_some()
    }

    fn flash_busy_until(&self) -> Cycles {
        self.parts.flash.busy_until()
    }

    fn flash_prefetches(&self) -> bool {
        self.parts.flash.prefetches()
    }

    fn exception(&mut self, passage: &HandlerEvent) {
        if passage.exception != INTERRUPTS + CONVERTED {
            return;
        }
        let instructions = passage.instructions;
        let moment = if passage.entered {
            self.load.entered(self.now, instructions, passage.since);
            self.hear();
            Moment::Entered
        } else {
            self.load.left(self.now, instructions);
            Moment::Left
        };
        if let Some(probe) = &mut self.probe {
            let probed = Probed {
                parts: &self.parts,
                memories: &self.memories,
                now: self.now,
            };
            probe(moment, &probed);
        }
    }
}
