//! The virtual board as a machine that the emulator's library runs: on its links, by its clock.

mod faults;

use embedded_storage::nor_flash::{NorFlash, ReadNorFlash};
use siskin_control::esc::obey;
use siskin_control::mavlink::Request;
use siskin_control::store;
use siskin_emulator::device::Start;
use siskin_emulator::fault::{Fault, Timeline};
use siskin_emulator::flash::{ERASED, FLASH_BYTES, FileFlash, FlashError, PAGE_BYTES, WORD_BYTES};
use siskin_emulator::link::LinkId;
use siskin_emulator::machine::{Machine, Onlooker, Stopped};
use siskin_emulator::summary::Rejected;
use siskin_emulator::surroundings::Surroundings as Bench;
use siskin_emulator::wire::Wire;
use siskin_params::Params;

use crate::chip::flash::{Change, Flash};
use crate::chip::{CODE, Cause, STORE};
use crate::image::Image;
use crate::load::Figures;
use crate::memory::Memory;
use crate::processor::{Mapped, Processor, Stop, Surroundings};
use crate::serial::{Mavlink, Telemetry};
use crate::time::{ns, of_ns};
use crate::world::{Event, World};

/// All of the store, in the file's offsets.
const ALL: std::ops::Range<u32> = 0..FLASH_BYTES as u32;

/// CCM SRAM and SRAM, rounded up to the engine's pages: each 2 KB more than the chip has.
const CCM: (u32, usize) = (0x1000_0000, 12 * 1024);
const SRAM: (u32, usize) = (0x2000_0000, 24 * 1024);

/// MAVLink's line; the other one carries telemetry.
const MAVLINK: u8 = 2;

/// A board with an image in its flash.
pub struct VirtualBoard {
    processor: Processor<World>,
    /// The parameters at the start.
    params: Params,
    now_ns: u64,
    locked_up: bool,
    faults: Timeline,
    /// Whether it is held in reset, and whether for lack of a supply.
    held: bool,
    starved: bool,
    wire: Wire,
    flash: FileFlash,
    /// What the chip's store held at the start and the file does not, until the chip stores.
    unwritten: Option<Vec<u8>>,
    mavlink: Mavlink,
    telemetry: Telemetry,
}

impl VirtualBoard {
    /// Creates a board with this image at power-up, with what `start` provides, and a warning if what was
    /// stored is damaged.
    ///
    /// The image knows no command line: parameters set over the stored ones are put into its flash first,
    /// and are stored with the others when it stores.
    ///
    /// # Errors
    /// The parameters cannot be put there.
    pub fn new(image: &Image, start: Start) -> Result<(Self, Option<&'static str>), Stopped> {
        let Start {
            bench,
            mut wire,
            mut flash,
            overrides,
            defaults,
            faults,
            ..
        } = start;
        wire.sow(bench.seed);
        let loaded = store::load(&mut flash, ALL);
        let warning = loaded.trouble();
        let mut stored = bytes(&mut flash);
        let mut unwritten = None;
        let mut kept = loaded.kept;
        let mut given = defaults;
        given.retain(|(id, _)| kept.params.is_default(*id));
        given.extend(overrides);
        if !given.is_empty() {
            for (id, value) in given {
                // It was checked when it was given.
                let _ = kept.params.set(id, value);
            }
            // Behind what is stored, where the chip's own changes follow.
            let mut other = FileFlash::in_memory();
            replace(&mut other, &stored).map_err(|error| Stopped(format!("--storage: {error}")))?;
            obey(Request::Save, &mut other, ALL, &mut kept)
                .map_err(|reason| Stopped(format!("the parameters cannot be stored: {reason}")))?;
            stored = bytes(&mut other);
            unwritten = Some(stored.clone());
        }

        let code = Memory::new(CODE.start, CODE.len(), 0xff);
        for segment in &image.segments {
            code.load(segment.address, &segment.bytes);
        }
        let store = Memory::new(STORE.start, STORE.len(), 0xff);
        store.load(STORE.start, &stored);
        let rams = [CCM, SRAM].map(|(origin, bytes)| Memory::new(origin, bytes, 0));
        let writable = |memory: &Memory| Mapped {
            memory: memory.clone(),
            writable: true,
        };
        let mapped = [
            Mapped {
                memory: code,
                writable: false,
            },
            writable(&rams[0]),
            writable(&rams[1]),
        ];
        let setpoint = image.symbol(&["exchange", "ends", "SETPOINT"]);
        let world = World::new(
            Flash::new(store, STORE),
            rams.to_vec(),
            Bench::new(bench),
            setpoint.map(|(address, _)| address),
        );
        let mut processor = Processor::new(world, &mapped);
        processor.reset(CODE.start);
        let board = Self {
            processor,
            params: kept.params,
            now_ns: 0,
            locked_up: false,
            faults: Timeline::new(faults),
            held: false,
            starved: false,
            wire,
            flash,
            unwritten,
            mavlink: Mavlink::default(),
            telemetry: Telemetry::default(),
        };
        Ok((board, warning))
    }

    /// Returns the chip and the bench.
    pub fn world(&mut self) -> &mut World {
        self.processor.surroundings()
    }

    /// Returns the processor.
    pub fn processor(&mut self) -> &mut Processor<World> {
        &mut self.processor
    }

    /// Returns the parameters in its flash at the start.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// Returns the PWM interrupt's figures so far.
    pub fn figures(&mut self) -> Option<Figures> {
        let world = self.world();
        world.load.figures(world.now())
    }

    /// Resets the chip; the bench goes on.
    pub fn reset(&mut self, cause: Cause) {
        let world = self.processor.surroundings();
        world.restart(cause);
        if cause == Cause::Power {
            world.forget_memory();
        }
        self.locked_up = false;
        self.processor.reset(CODE.start);
    }

    /// Runs until a time.
    fn run(&mut self, until_ns: u64) -> Result<(), Stopped> {
        let until = of_ns(until_ns);
        self.world().until = until;
        while self.world().now() < until {
            let stop = if self.locked_up || self.held {
                self.world().idle(until);
                Stop::Asked
            } else {
                self.processor.run()
            };
            let world = self.processor.surroundings();
            if let Some(stopped) = world.failed.clone() {
                return Err(stopped);
            }
            if let Some(violation) = world.bridge().first().first() {
                return Err(Stopped(violation.to_string()));
            }
            match stop {
                Stop::Asked => {}
                Stop::Reset => world.reset = Some(Cause::Software),
                Stop::LockedUp => {
                    world.lock_up();
                    self.locked_up = true;
                }
                Stop::Unmodelled {
                    address,
                    pc,
                    written,
                } => {
                    let what = match written {
                        Some(value) => format!("{value:#x} is written to"),
                        None => "what is read is".to_owned(),
                    };
                    return Err(Stopped(format!(
                        "{what} {address:#010x} at pc {pc:#010x}, which is not modelled"
                    )));
                }
                Stop::Undefined { pc } => {
                    return Err(Stopped(format!(
                        "the engine does not know the instruction at pc {pc:#010x}"
                    )));
                }
            }
            if let Some(cause) = self.world().reset.take() {
                self.reset(cause);
            }
        }
        Ok(())
    }

    /// Passes on what has happened.
    fn tell(&mut self, onlooker: &mut impl Onlooker, send: &mut dyn FnMut(&[u8])) {
        let world = self.processor.surroundings();
        let now = world.now();
        for event in std::mem::take(&mut world.happened) {
            match event {
                Event::Passage(t_s, passage) => onlooker.passage(t_s, &passage),
                Event::Gates(at, leg, gate) => onlooker.gates(ns(at), leg, gate),
                Event::Edge(at, level) => onlooker.edge(ns(at), level),
                Event::Reply(reply) => {
                    let datagram = reply.datagram();
                    onlooker.answer(reply.asked_ns, &datagram);
                    self.wire.send(reply.asked_ns, &datagram);
                }
                Event::Byte(at, MAVLINK, byte) => self.mavlink.sent(at, &[byte], |frame| {
                    onlooker.frame(ns(at), frame);
                    send(frame);
                }),
                Event::Byte(at, _, byte) => self.telemetry.sent(at, byte),
            }
        }
        self.mavlink.sent(now, &[], |frame| {
            onlooker.frame(ns(now), frame);
            send(frame);
        });
        if let Some(datagram) = self.telemetry.take(now) {
            let asked_ns = self.processor.surroundings().throttle.frame_ns();
            let asked_ns = asked_ns.unwrap_or(0);
            onlooker.answer(asked_ns, &datagram);
            self.wire.send(asked_ns, &datagram);
        }
    }

    /// Writes what the chip has changed in its store to the file.
    fn persist(&mut self) -> Result<(), Stopped> {
        let changes = self.processor.surroundings().parts().flash.take_changes();
        let failed = |error: &dyn std::fmt::Display| Stopped(format!("--storage: {error}"));
        let changed = !changes.is_empty();
        if changed && let Some(stored) = self.unwritten.take() {
            replace(&mut self.flash, &stored).map_err(|error| failed(&error))?;
        }
        for change in changes {
            let written = match change {
                Change::Erased { offset } => self.flash.erase(offset, offset + PAGE_BYTES as u32),
                Change::Programmed { offset, bytes } => self.flash.write(offset, &bytes),
            };
            written.map_err(|error| failed(&error))?;
        }
        if changed {
            self.flash.sync().map_err(|error| failed(&error))?;
        }
        Ok(())
    }
}

impl Machine for VirtualBoard {
    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn is_before(&self, until_ns: u64) -> bool {
        self.now_ns < until_ns
    }

    fn wire(&mut self, _: usize) -> &mut Wire {
        &mut self.wire
    }

    fn receive(&mut self, stream: LinkId, bytes: &[u8], onlooker: &mut impl Onlooker) {
        let world = self.processor.surroundings();
        let now = world.now();
        let waiting = world.parts().usart2.waiting();
        let mut frames = Vec::new();
        self.mavlink.receive(stream, now, bytes, waiting, |frame| {
            onlooker.frame(ns(now), frame);
            frames.extend_from_slice(frame);
        });
        world.serial(&frames);
    }

    fn forget(&mut self, stream: LinkId) {
        self.mavlink.forget(stream);
    }

    fn advance(
        &mut self,
        until_ns: u64,
        onlooker: &mut impl Onlooker,
        send: &mut dyn FnMut(&[u8]),
    ) -> Result<(), Stopped> {
        for stream in self.mavlink.links() {
            self.receive(stream, &[], onlooker);
        }
        let world = self.processor.surroundings();
        world.throttle.take(&mut self.wire, until_ns);
        world.edges_come();
        let ran = self.play(until_ns);
        self.tell(onlooker, send);
        self.persist()?;
        ran
    }

    fn inject(&mut self, _: usize, fault: Fault) -> Result<(), &'static str> {
        self.faults.inject(self.now_ns as f64 * 1e-9, fault);
        Ok(())
    }

    fn mend(&mut self, _: usize) -> Result<(), &'static str> {
        self.faults.mend(self.now_ns as f64 * 1e-9);
        Ok(())
    }

    fn rejected(&self, _: usize) -> Rejected {
        let wire = self.wire.counts();
        Rejected {
            wire_datagrams: wire.rejected + wire.dropped,
            // The chip reports its refusals by MAVLink.
            wire_frames: 0,
            mavlink_frames: self.mavlink.refused(),
            lockstep_requests: None,
        }
    }
}

/// Makes the file hold these bytes. Erases only pages with words that change their content.
fn replace(flash: &mut FileFlash, wanted: &[u8]) -> Result<(), FlashError> {
    let held = bytes(flash);
    let pages = held.chunks(PAGE_BYTES).zip(wanted.chunks(PAGE_BYTES));
    for (page, (held, wanted)) in pages.enumerate() {
        let page = (page * PAGE_BYTES) as u32;
        let words = || held.chunks(WORD_BYTES).zip(wanted.chunks(WORD_BYTES));
        let is_erased = |word: &[u8]| word.iter().all(|byte| *byte == ERASED);
        let erases = words().any(|(held, wanted)| held != wanted && !is_erased(held));
        if erases {
            flash.erase(page, page + PAGE_BYTES as u32)?;
        }
        for (number, (held, wanted)) in words().enumerate() {
            if !is_erased(wanted) && (erases || held != wanted) {
                flash.write(page + (number * WORD_BYTES) as u32, wanted)?;
            }
        }
    }
    Ok(())
}

/// Returns all bytes of the file.
fn bytes(flash: &mut FileFlash) -> Vec<u8> {
    let mut bytes = vec![0; FLASH_BYTES];
    // All of it can be read: it is in memory.
    let _ = flash.read(0, &mut bytes);
    bytes
}
