//! The reply to a bidirectional frame, sent from the pin that the frame came in on.
//!
//! A second timer paces the DMA, which writes a word to the register that sets the pin's level at each
//! bit: the capturing timer goes on counting.
//!
//! As much as possible is prepared before the frame has ended: at its end a few accesses start a reply
//! that is due 30 µs later.

use core::ptr;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::dma::{self, TransferOptions};
use embassy_stm32::pac::timer::vals::Urs;
use siskin_control::answer::{Reply, gcr};

use super::capture::Capture;
use crate::board::wire::{
    PACE, PACE_HZ, PaceTimer, TICK_HZ, drive_pin, level_register, level_word,
};
use crate::pace::delay_clocks;

/// Bits of a reply, of which the last one is high in each, as the line rests ([`gcr::encode`]).
const WORDS: usize = gcr::BITS as usize;

/// Sends replies.
pub(crate) struct Replier {
    channel: dma::Channel<'static>,
    request: dma::Request,
    /// The words written to the pin, bit by bit.
    words: [AtomicU32; WORDS],
}

impl Replier {
    /// The pacing timer belongs to this from now on; the DMA's channel serves its update.
    pub(crate) fn new(channel: dma::Channel<'static>, request: dma::Request) -> Self {
        embassy_stm32::rcc::enable_and_reset::<PaceTimer>();
        PACE.cr1().modify(|w| {
            w.set_arpe(true);
            // An update that the program makes, to load the first period, is no request to the DMA.
            w.set_urs(Urs::COUNTER_ONLY);
        });
        Self {
            channel,
            request,
            words: [const { AtomicU32::new(0) }; WORDS],
        }
    }

    /// Makes ready to send a reply of these bits, or of others.
    pub(super) fn arm(&mut self, bits: u32) -> Armed<'_> {
        PACE.cnt().write(|w| w.set_cnt(0));
        write_words(&self.words, bits);
        let mut options = TransferOptions::default();
        options.complete_transfer_ir = false;
        let words = ptr::slice_from_raw_parts(self.words.as_ptr().cast::<u32>(), WORDS);
        // SAFETY: what is written to the register moves the throttle's pin alone; the words live until the
        // transfer has ended. They may change before it begins: they are read as they go out, but for the
        // first, which the F405's stream may take at once and which is the start bit in every reply.
        let transfer = unsafe {
            self.channel
                .write_raw(self.request, words, level_register(), options)
        };
        Armed {
            words: &self.words,
            bits,
            _transfer: transfer,
        }
    }
}

/// The words of a reply's bits.
fn write_words(words: &[AtomicU32; WORDS], bits: u32) {
    // The highest comes first.
    let mut bits = bits << (32 - WORDS);
    for word in words {
        word.store(level_word(bits >> 31 == 1), Ordering::Relaxed);
        bits <<= 1;
    }
}

/// A reply that can begin.
pub(super) struct Armed<'a> {
    words: &'a [AtomicU32; WORDS],
    bits: u32,
    /// A dropped one ends.
    _transfer: dma::Transfer<'a>,
}

impl<'a> Armed<'a> {
    /// Begins to send a reply at its time; nothing, if that has passed.
    pub(super) fn begin(self, capture: &mut Capture, reply: &Reply) -> Option<Sending<'a>> {
        if reply.bits != self.bits {
            write_words(self.words, reply.bits);
        }
        let bit_clocks = (PACE_HZ / reply.bit_hz - 1) as u16;
        // The first update comes at the reply's time and the others a bit apart each: what is written
        // to the period is loaded by the next update. The control's interrupt would take 3 µs between
        // reading the time and the start: it waits for these 0.3 µs.
        let begun = cortex_m::interrupt::free(|_| {
            let ticks = reply.at_ticks.wrapping_sub(capture.now());
            let Some(delay) = delay_clocks(ticks, PACE_HZ / TICK_HZ) else {
                return false;
            };
            PACE.arr().write(|w| w.set_arr(delay));
            PACE.egr().write(|w| w.set_ug(true));
            PACE.arr().write(|w| w.set_arr(bit_clocks));
            PACE.dier().write(|w| w.set_ude(true));
            PACE.cr1().modify(|w| w.set_cen(true));
            // Not after what would hold it up beyond the first bit.
            drive_pin(true);
            true
        });
        // In the middle of the last bit.
        let bit_halves = 2 * WORDS as u32 - 1;
        let over_ticks = TICK_HZ / 2 * bit_halves / reply.bit_hz;
        begun.then(|| Sending {
            over_ticks: reply.at_ticks.wrapping_add(over_ticks),
            _armed: self,
        })
    }
}

/// A reply that is on its way.
pub(super) struct Sending<'a> {
    over_ticks: u32,
    _armed: Armed<'a>,
}

impl Sending<'_> {
    /// Waits for its last bit, within which it lets the pin go: the line is high already. Returns when
    /// that was, as the reply has it: edges before it were the reply's own.
    pub(super) async fn end(self, capture: &mut Capture) -> u32 {
        capture.wait_until(self.over_ticks).await;
        drive_pin(false);
        PACE.cr1().modify(|w| w.set_cen(false));
        // The counter has gone on behind the last word, and a request that nothing serves stands until it
        // is not enabled any more: the next reply would begin with it, whenever that is to be.
        PACE.dier().write(|w| w.set_ude(false));
        self.over_ticks
    }
}
