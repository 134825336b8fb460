//! A ring in memory into which the DMA puts the times of one direction's edges.
//!
//! Where the DMA is tells how many there are: no interrupt counts its rounds, which would have to come
//! before the throttle's task looks, and hold it up.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::dma::{Channel, Request, Transfer, TransferOptions};

/// Edges of one direction that the memory takes between two looks: two DShot frames.
pub(super) const LEN: usize = 32;

/// The memory.
pub(super) type Memory = [AtomicU32; LEN];

/// The ring.
pub(super) struct Ring {
    transfer: Transfer<'static>,
    memory: &'static Memory,
    /// Where the next time is, and where the DMA was at the last look.
    at: usize,
    end: usize,
    /// The time before the next one: another there tells that the DMA has come round.
    before: u32,
}

impl Ring {
    /// Lets the channel fill the memory from now on.
    ///
    /// # Safety
    /// The register is of a timer that asks for these transfers, for ever.
    pub(super) unsafe fn new(
        channel: &'static mut Channel<'static>,
        request: Request,
        register: *mut u32,
        memory: &'static Memory,
    ) -> Self {
        let mut options = TransferOptions::default();
        options.circular = true;
        options.half_transfer_ir = false;
        options.complete_transfer_ir = false;
        let words = core::ptr::slice_from_raw_parts_mut(memory.as_ptr().cast_mut().cast(), LEN);
        // SAFETY: the memory stays where it is and may change behind a shared reference; the register by
        // the caller.
        let transfer = unsafe { channel.read_raw::<u32, u32>(request, register, words, options) };
        Self {
            transfer,
            memory,
            at: 0,
            end: 0,
            before: 0,
        }
    }

    /// Takes in what has come. False if more came than the memory takes: what it has is forgotten.
    pub(super) fn fill(&mut self) -> bool {
        self.end = (LEN - self.transfer.get_remaining_transfers() as usize) % LEN;
        let whole = self.word(LEN - 1) == self.before;
        if !whole {
            self.clear();
        }
        whole
    }

    /// Forgets what it has.
    pub(super) fn clear(&mut self) {
        self.skip(self.count());
    }

    /// Leaves so many of the times behind.
    pub(super) fn skip(&mut self, count: usize) {
        self.at = (self.at + count) % LEN;
        self.before = self.word(LEN - 1);
    }

    /// How many times it has.
    pub(super) fn count(&self) -> usize {
        (self.end + LEN - self.at) % LEN
    }

    /// One of its times, the next is 0.
    #[inline(always)]
    pub(super) fn word(&self, index: usize) -> u32 {
        self.words()(index)
    }

    /// Its times, the next is 0.
    #[inline(always)]
    pub(super) fn words(&self) -> impl Fn(usize) -> u32 + use<> {
        let (memory, at) = (self.memory, self.at);
        move |index| memory[(at + index) % LEN].load(Ordering::Relaxed)
    }
}
