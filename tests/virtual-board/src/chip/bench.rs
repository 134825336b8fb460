//! A bench for testing a part alone.

use super::{Context, Part, Signal, Unmodelled};
use crate::time::Cycles;

/// A part, the time, and its signals with their times.
pub(super) struct Bench<P> {
    pub(super) part: P,
    pub(super) now: Cycles,
    pub(super) log: Vec<(Cycles, Signal)>,
}

impl<P: Part> Bench<P> {
    pub(super) fn new(part: P, now: Cycles) -> Self {
        Self {
            part,
            now,
            log: Vec::new(),
        }
    }

    /// Does something with it at the current time.
    pub(super) fn with<R>(&mut self, act: impl FnOnce(&mut P, &mut Context) -> R) -> R {
        let mut signals = Vec::new();
        let mut context = Context {
            now: self.now,
            signals: &mut signals,
        };
        let result = act(&mut self.part, &mut context);
        let now = self.now;
        self.log
            .extend(signals.into_iter().map(|signal| (now, signal)));
        result
    }

    pub(super) fn try_write(&mut self, offset: u32, value: u32) -> Result<(), Unmodelled> {
        self.with(|part, context| part.write(offset, value, context))
    }

    pub(super) fn write(&mut self, offset: u32, value: u32) {
        self.try_write(offset, value).expect("it is modelled");
    }

    pub(super) fn read(&mut self, offset: u32) -> u32 {
        self.with(|part, context| part.read(offset, context))
            .expect("it is modelled")
    }

    /// Lets it act up to and including a time.
    pub(super) fn until(&mut self, end: Cycles) {
        while self.part.due() <= end {
            assert!(self.part.due() > self.now, "what was due has been done");
            self.now = self.part.due();
            self.with(Part::act);
        }
        self.now = end;
    }
}
