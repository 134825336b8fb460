//! The reply to a bidirectional frame, sent from the pin that the frame came in on.
//!
//! A second timer paces the DMA, which writes a word to the port's set and reset register at each
//! bit: the capturing timer goes on undisturbed.

use embassy_stm32::dma::{self, TransferOptions};
use embassy_stm32::pac::gpio::vals::Moder;
use embassy_stm32::pac::timer::vals::Urs;
use siskin_control::answer::Reply;

use super::capture::Capture;
use crate::board::wire::{PACE, PACE_HZ, PIN, PORT, PaceTimer, TICK_HZ};
use crate::pace::delay_clocks;

/// Bits of a reply, and the level at which the line is left.
const WORDS: usize = 22;

/// What sends replies.
pub(crate) struct Replier {
    channel: dma::Channel<'static>,
    request: dma::Request,
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
        PACE.dier().modify(|w| w.set_ude(true));
        // As the line rests, for when the pin is turned round.
        PORT.bsrr().write(|w| w.set_bs(PIN, true));
        Self { channel, request }
    }

    /// Sends a reply at its time; false, and nothing is sent, if that has passed.
    pub(super) async fn send(&mut self, capture: &mut Capture, reply: &Reply) -> bool {
        let words: [u32; WORDS] = core::array::from_fn(|index| {
            // Bit 20 comes first; after bit 0 the line rests high.
            let high = index == WORDS - 1 || reply.bits >> (WORDS - 2 - index) & 1 == 1;
            1 << if high { PIN } else { PIN + 16 }
        });
        PACE.cr1().modify(|w| w.set_cen(false));
        PACE.cnt().write(|w| w.set_cnt(0));
        // SAFETY: the register belongs to the port of this pin, and its words touch this pin alone;
        // the words live until the transfer has ended.
        let transfer = unsafe {
            let register = PORT.bsrr().as_ptr().cast::<u32>();
            let options = TransferOptions::default();
            self.channel.write(self.request, &words, register, options)
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
            PACE.cr1().modify(|w| w.set_cen(true));
            true
        });
        if begun {
            set_mode(Moder::OUTPUT);
            transfer.await;
            set_mode(Moder::ALTERNATE);
        }
        PACE.cr1().modify(|w| w.set_cen(false));
        begun
    }
}

fn set_mode(mode: Moder) {
    PORT.moder().modify(|w| w.set_moder(PIN, mode));
}
