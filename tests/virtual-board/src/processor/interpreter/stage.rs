//! What the interpreter's bus reaches while it runs.
//!
//! The crate's bus takes only what may go to another thread, and the chip may not. So an interpreter that
//! runs puts its memory and surroundings here, with its thread, and takes them back when it stops.

use std::any::Any;
use std::cell::RefCell;
use std::ops::Range;

use rsemu::core::BusError as Refusal;
use rsemu::core::space::{MemAttrs, MemOps, MemResult};

use crate::processor::{BusError, Mapped, Surroundings, Width};

thread_local! {
    static STAGE: RefCell<Option<Scene>> = const { RefCell::new(None) };
}

/// Surroundings whose type is known again when they come back.
pub(super) trait Around: Surroundings + Any {}

impl<S: Surroundings + Any> Around for S {}

/// The chip's memories, each a part of its own: SRAM1, SRAM2 and the CCM SRAM (RM0440, 2.2.2).
const RAMS: [Range<u32>; 3] = [
    0x2000_0000..0x2000_4000,
    0x2000_4000..0x2000_5800,
    0x1000_0000..0x1000_2800,
];

/// What an interpreter stands in, and what its bus has seen of the step under way.
pub(super) struct Scene {
    pub(super) surroundings: Box<dyn Around>,
    memories: Vec<Mapped>,
    /// Where the step's instruction lies, if it has one.
    pub(super) fetched: Option<u32>,
    /// The last word that was read as data.
    pub(super) last_read: Option<u32>,
    /// Whether a write found nothing.
    pub(super) write_lost: bool,
    /// The memories that nothing has been done with since the reset.
    untouched: [bool; RAMS.len()],
    /// How many of them were written first, which a chip may not have taken (ES0431).
    pub(super) written_first: u32,
    /// An access that is not modelled: its address, and what was written.
    pub(super) unmodelled: Option<(u32, Option<u32>)>,
}

impl Scene {
    pub(super) fn new(surroundings: Box<dyn Around>, memories: &[Mapped]) -> Self {
        Self {
            surroundings,
            memories: memories.to_vec(),
            fetched: None,
            last_read: None,
            write_lost: false,
            untouched: [true; RAMS.len()],
            written_first: 0,
            unmodelled: None,
        }
    }

    /// The chip is reset.
    pub(super) fn reset(&mut self) {
        self.untouched = [true; RAMS.len()];
    }

    /// Whether this is the first that is done with a memory since the reset.
    fn touches(&mut self, address: u32) -> bool {
        let ram = RAMS.iter().position(|ram| ram.contains(&address));
        ram.is_some_and(|ram| std::mem::take(&mut self.untouched[ram]))
    }

    /// Forgets the step before.
    pub(super) fn begin(&mut self) {
        self.fetched = None;
        self.last_read = None;
        self.write_lost = false;
    }

    /// The memory that has these bytes.
    pub(super) fn memory(&self, address: u32, bytes: u32) -> Option<&Mapped> {
        let holds = |mapped: &&Mapped| mapped.memory.holds(address, bytes);
        self.memories.iter().find(holds)
    }

    fn fetch(&mut self, address: u32) -> Result<u32, BusError> {
        self.fetched.get_or_insert(address);
        let mapped = self.memory(address, 2).ok_or(BusError::Nothing)?;
        Ok(mapped.memory.read(address, 2))
    }

    fn read(&mut self, address: u32, width: Width) -> Result<u32, BusError> {
        self.last_read = Some(address);
        self.touches(address);
        match self.memory(address, width.bytes()) {
            Some(mapped) => Ok(mapped.memory.read(address, width.bytes())),
            None => self.surroundings.read(address, width),
        }
    }

    fn write(&mut self, address: u32, width: Width, value: u32) -> Result<(), BusError> {
        match self.memory(address, width.bytes()) {
            Some(mapped) if mapped.writable => {
                mapped.memory.write(address, width.bytes(), value);
                self.written_first += u32::from(self.touches(address));
                Ok(())
            }
            _ => self.surroundings.write(address, width, value),
        }
    }

    /// What the core is told of an access: one that is not modelled passes, and the run ends after it.
    fn answer<T: Default>(
        &mut self,
        outcome: Result<T, BusError>,
        address: u32,
        written: Option<u32>,
    ) -> MemResult<T> {
        match outcome {
            Ok(value) => Ok(value),
            Err(BusError::Nothing) => {
                self.write_lost |= written.is_some();
                Err(Refusal::Unassigned)
            }
            Err(BusError::Unmodelled) => {
                self.unmodelled.get_or_insert((address, written));
                Ok(T::default())
            }
        }
    }
}

/// Puts a scene on the stage.
pub(super) fn enter(scene: Scene) {
    STAGE.set(Some(scene));
}

/// Takes it off again.
pub(super) fn leave() -> Option<Scene> {
    STAGE.take()
}

/// Does something with the scene that is on the stage.
pub(super) fn with<T>(act: impl FnOnce(&mut Scene) -> T) -> T {
    STAGE.with_borrow_mut(|stage| act(stage.as_mut().expect("an interpreter runs")))
}

/// The bus: all addresses but the core's own.
#[derive(Debug)]
pub(super) struct Bus;

impl MemOps for Bus {
    fn read(&self, offset: u64, into: &mut [u8], attributes: MemAttrs) -> MemResult {
        let (address, count) = (offset as u32, into.len());
        let value = with(|scene| {
            let outcome = if attributes.is_fetch() {
                scene.fetch(address)
            } else {
                scene.read(address, width(count)?)
            };
            scene.answer(outcome, address, None)
        })?;
        into.copy_from_slice(&value.to_le_bytes()[..count]);
        Ok(())
    }

    fn write(&self, offset: u64, from: &[u8], _: MemAttrs) -> MemResult {
        let address = offset as u32;
        let fold = |value, byte: &u8| value << 8 | u32::from(*byte);
        let value = from.iter().rev().fold(0, fold);
        with(|scene| {
            let outcome = scene.write(address, width(from.len())?, value);
            scene.answer(outcome, address, Some(value))
        })
    }
}

fn width(bytes: usize) -> MemResult<Width> {
    match bytes {
        1 => Ok(Width::Byte),
        2 => Ok(Width::Half),
        4 => Ok(Width::Word),
        _ => Err(Refusal::BadAccess),
    }
}
