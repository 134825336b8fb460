//! Sends the reply to a bidirectional frame, on the pin that the frame came in on.
//!
//! A second timer paces the DMA, which writes a word per bit to the register that sets the pin's level: the
//! capture timer keeps counting.
//!
//! As much as possible is prepared before the frame ends: then a few register accesses start a reply that is
//! due 30 µs later.

use core::ptr;
use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::dma::{self, TransferOptions};
use embassy_stm32::pac::timer::vals::Urs;
use siskin_throttle::answer::{Reply, gcr};

use super::capture::Capture;
use crate::board::wire::{
    PACE, PACE_HZ, PaceTimer, TICK_HZ, drive_pin, level_register, level_word,
};
use crate::pace::delay_clocks;

/// Bits of a reply. The last is always high, like the line at rest ([`gcr::encode`]).
const WORDS: usize = gcr::BITS as usize;

/// Sends replies.
pub(crate) struct Replier {
    channel: dma::Channel<'static>,
    request: dma::Request,
    /// The words written to the pin, bit by bit.
    words: [AtomicU32; WORDS],
}

impl Replier {
    /// Takes over the pacing timer, and the DMA channel that serves its update.
    pub(crate) fn new(channel: dma::Channel<'static>, request: dma::Request) -> Self {
        embassy_stm32::rcc::enable_and_reset::<PaceTimer>();
        PACE.cr1().modify(|w| {
            w.set_arpe(true);
            // The update forced by software, to load the first period, must not request DMA.
            w.set_urs(Urs::COUNTER_ONLY);
        });
        Self {
            channel,
            request,
            words: [const { AtomicU32::new(0) }; WORDS],
        }
    }

    /// Prepares a reply with these bits, which may still change.
    pub(super) fn arm(&mut self, bits: u32) -> Armed<'_> {
        PACE.cnt().write(|w| w.set_cnt(0));
        write_words(&self.words, bits);
        let mut options = TransferOptions::default();
        options.complete_transfer_ir = false;
        let words = ptr::slice_from_raw_parts(self.words.as_ptr().cast::<u32>(), WORDS);
        // SAFETY: writes to the register only move the throttle pin; the words live until the transfer has
        // ended. They may change before it starts, since they are read as they go out; except the first, which
        // the F405's stream may prefetch, and which is the start bit in every reply.
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

/// Fills in the words for a reply's bits.
fn write_words(words: &[AtomicU32; WORDS], bits: u32) {
    // Highest bit first.
    let mut bits = bits << (32 - WORDS);
    for word in words {
        word.store(level_word(bits >> 31 == 1), Ordering::Relaxed);
        bits <<= 1;
    }
}

/// A reply that is ready to start.
pub(super) struct Armed<'a> {
    words: &'a [AtomicU32; WORDS],
    bits: u32,
    /// Dropping it ends the transfer.
    _transfer: dma::Transfer<'a>,
}

impl<'a> Armed<'a> {
    /// Starts the reply at its time; returns `None` if that has passed.
    pub(super) fn begin(self, capture: &mut Capture, reply: &Reply) -> Option<Sending<'a>> {
        if reply.bits != self.bits {
            write_words(self.words, reply.bits);
        }
        let bit_clocks = (PACE_HZ / reply.bit_hz - 1) as u16;
        // The first update comes at the reply's time and the others one bit apart: what is written to the
        // period is loaded at the next update. The control interrupt would take 3 µs between reading the time
        // and the start: it waits for these 0.3 µs.
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
            // Before anything could delay it past the first bit.
            drive_pin(true);
            true
        });
        // The middle of the last bit.
        let bit_halves = 2 * WORDS as u32 - 1;
        let over_ticks = TICK_HZ / 2 * bit_halves / reply.bit_hz;
        begun.then(|| Sending {
            over_ticks: reply.at_ticks.wrapping_add(over_ticks),
            _armed: self,
        })
    }
}

/// A reply on its way.
pub(super) struct Sending<'a> {
    over_ticks: u32,
    _armed: Armed<'a>,
}

impl Sending<'_> {
    /// Waits for the last bit and releases the pin within it, with the line already high. Returns the nominal
    /// time of that: edges before it were the reply's own.
    pub(super) async fn end(self, capture: &mut Capture) -> u32 {
        capture.wait_until(self.over_ticks).await;
        drive_pin(false);
        PACE.cr1().modify(|w| w.set_cen(false));
        // The counter has run on past the last word, and its unserved request stays pending until it is
        // disabled: the next reply would start with it, whenever that is.
        PACE.dier().write(|w| w.set_ude(false));
        self.over_ticks
    }
}
