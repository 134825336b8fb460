//! The reply to a bidirectional frame, sent from the pin that the frame came in on.
//!
//! A second timer paces the DMA, which writes a word to the port's set and reset register at each
//! bit: the capturing timer goes on undisturbed.

use embassy_stm32::dma::{self, TransferOptions};
use embassy_stm32::pac::gpio::vals::Moder;
use embassy_stm32::pac::timer::vals::Urs;
use siskin_control::answer::{Reply, gcr};

use super::capture::Capture;
use crate::board::wire::{PACE, PACE_HZ, PIN, PORT, PaceTimer, TICK_HZ};
use crate::pace::delay_clocks;

/// Bits of a reply, and the level at which the line is left.
const WORDS: usize = 22;

/// What sends replies.
pub(crate) struct Replier {
    channel: dma::Channel<'static>,
    request: dma::Request,
    /// What is written to the pin's port, bit by bit.
    words: [u32; WORDS],
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
        // As the line rests, for when the pin is turned round.
        PORT.bsrr().write(|w| w.set_bs(PIN, true));
        Self {
            channel,
            request,
            words: [1 << PIN; WORDS],
        }
    }

    /// Begins to send a reply at its time; nothing, if that has passed.
    #[inline(never)]
    pub(super) fn begin(&mut self, capture: &mut Capture, reply: &Reply) -> Option<Sending<'_>> {
        // Bit 20 comes first; after bit 0 the line rests high, as the last word has it.
        let mut bits = !reply.bits << (32 - gcr::BITS);
        for word in &mut self.words[..WORDS - 1] {
            // A zero resets the pin, by the upper half of the register.
            *word = 1 << PIN << (bits >> 31 << 4);
            bits <<= 1;
        }
        PACE.cnt().write(|w| w.set_cnt(0));
        // SAFETY: the register belongs to the port of this pin, and its words touch this pin alone;
        // the words live until the transfer has ended.
        let transfer = unsafe {
            let register = PORT.bsrr().as_ptr().cast::<u32>();
            let options = TransferOptions::default();
            self.channel
                .write(self.request, &self.words, register, options)
        };
        // The first update comes at the reply's time and the others a bit apart each: what is written
        // to the period is loaded by the next update. The control's interrupt would take 3 µs between
        // reading the time and the start: it waits for these 0.2 µs.
        let begun = cortex_m::interrupt::free(|_| {
            let ticks = reply.at_ticks.wrapping_sub(capture.now());
            let Some(delay) = delay_clocks(ticks, PACE_HZ / TICK_HZ) else {
                return false;
            };
            PACE.arr().write(|w| w.set_arr(delay));
            PACE.egr().write(|w| w.set_ug(true));
            PACE.arr()
                .write(|w| w.set_arr((PACE_HZ / reply.bit_hz - 1) as u16));
            request_updates(true);
            PACE.cr1().modify(|w| w.set_cen(true));
            // Not after what would hold it up beyond the first bit.
            set_mode(Moder::OUTPUT);
            true
        });
        // One that is dropped does not begin.
        begun.then_some(Sending { transfer })
    }
}

/// A reply that is on its way.
pub(super) struct Sending<'a> {
    transfer: dma::Transfer<'a>,
}

impl Sending<'_> {
    /// Waits for its end, and lets the pin go.
    pub(super) async fn end(self) {
        self.transfer.await;
        set_mode(Moder::ALTERNATE);
        PACE.cr1().modify(|w| w.set_cen(false));
        // The counter has gone on behind the last word, and a request that nothing serves stands until it
        // is not enabled any more: the next reply would begin with it, whenever that is to be.
        request_updates(false);
    }
}

/// Whether the counter's updates ask the DMA for the next word.
fn request_updates(on: bool) {
    PACE.dier().modify(|w| w.set_ude(on));
}

fn set_mode(mode: Moder) {
    PORT.moder().modify(|w| w.set_moder(PIN, mode));
}
