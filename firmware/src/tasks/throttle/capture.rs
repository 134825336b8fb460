//! The wire's edges: the timer captures the times of rising edges on one channel and of falling ones on
//! another, each into a ring in memory by DMA, so that an edge costs no interrupt.
//!
//! The processor looks at the rings when a frame should be complete.

use core::ptr;
use core::sync::atomic::AtomicU32;

use embassy_stm32::dma::{self, TransferOptions};
use embassy_stm32::interrupt::typelevel::Interrupt;
use embassy_stm32::timer::GeneralInstance1Channel;
use static_cell::StaticCell;

use crate::board::wire::{CAPTURE, CaptureTimer, PRESCALER, SIGNAL_CHANNEL, TICK_HZ, TIMER_BITS};
use crate::chip::capture::{capture_on, wait_for_alarm, wait_for_edge};
use crate::edges::{Edges, LEN, Memory};

/// A younger edge may not be in memory yet: the DMA takes some ten clocks of its bus, more while it serves
/// others. 0.5 µs.
const SETTLED_TICKS: u32 = TICK_HZ / 2_000_000;

/// Its interrupt. A wait that ends before the task has left the processor leaves it pending, and the next one would
/// take it for an edge: each wait begins with it clear.
type CaptureInterrupt = <CaptureTimer as GeneralInstance1Channel>::CaptureCompareInterrupt;

/// The counter's maximum.
const COUNTER_MASK: u32 = u32::MAX >> (32 - TIMER_BITS);

/// Converts a time to ticks.
pub(super) const fn ticks_of_us(time_us: u32) -> u32 {
    (TICK_HZ as u64 * time_us as u64 / 1_000_000) as u32
}

/// The edges of the wire.
pub(crate) struct Capture {
    pub(super) edges: Edges<TIMER_BITS>,
    /// DMA transfers of rising and falling edge times into memory.
    transfers: [dma::Transfer<'static>; 2],
}

impl Capture {
    /// Starts the timer, and takes it over along with the DMA channels of its first and second capture channel.
    /// The pin must already lead to it.
    pub(crate) fn new(channels: [dma::Channel<'static>; 2], requests: [dma::Request; 2]) -> Self {
        static MEMORY: [Memory; 2] = [const { [const { AtomicU32::new(0) }; LEN] }; 2];
        static CHANNELS: StaticCell<[dma::Channel<'static>; 2]> = StaticCell::new();
        embassy_stm32::rcc::enable_and_reset::<CaptureTimer>();
        CAPTURE.psc().write_value(PRESCALER - 1);
        CAPTURE.arr().write_value(COUNTER_MASK);
        for channel in 0..2 {
            capture_on(CAPTURE, channel, SIGNAL_CHANNEL);
        }
        CAPTURE.ccer().modify(|w| {
            w.set_ccp(1, true);
            w.set_cce(0, true);
            w.set_cce(1, true);
        });
        CAPTURE.dier().modify(|w| {
            w.set_ccde(0, true);
            w.set_ccde(1, true);
        });
        let transfer = |index: usize, channel: &'static mut dma::Channel<'static>| {
            let register = CAPTURE.ccr(index).as_ptr().cast::<u32>();
            let memory: *const Memory = &MEMORY[index];
            let words = ptr::slice_from_raw_parts_mut(memory.cast_mut().cast::<u32>(), LEN);
            let mut options = TransferOptions::default();
            options.circular = true;
            options.half_transfer_ir = false;
            options.complete_transfer_ir = false;
            // SAFETY: the register belongs to a timer that this owns for good; the memory does not move and may
            // change behind a shared reference.
            unsafe { channel.read_raw(requests[index], register, words, options) }
        };
        let [first, second] = CHANNELS.init(channels);
        let transfers = [transfer(0, first), transfer(1, second)];
        CAPTURE.egr().write(|w| w.set_ug(true));
        CAPTURE.cr1().modify(|w| w.set_cen(true));
        // SAFETY: the handler touches nothing but the timer, and wakes a task.
        unsafe { CaptureInterrupt::enable() };
        Self {
            edges: Edges::new(MEMORY.each_ref(), SETTLED_TICKS),
            transfers,
        }
    }
}

impl Capture {
    /// Returns the time; see [`Edges::now`].
    pub(super) fn now(&mut self) -> u32 {
        self.edges.now(CAPTURE.cnt().read())
    }

    /// Waits for an edge until a time at most. Returns true if one came.
    pub(super) async fn wait_for_edge(&mut self, due_ticks: u32) -> bool {
        let is_past = |now_ticks: u32| now_ticks.wrapping_sub(due_ticks) as i32 >= 0;
        let alarm_ticks = due_ticks & COUNTER_MASK;
        CaptureInterrupt::unpend();
        wait_for_edge(CAPTURE, alarm_ticks, || is_past(self.now())).await
    }

    /// Waits until a time.
    pub(super) async fn wait_until(&mut self, due_ticks: u32) {
        let is_past = |now_ticks: u32| now_ticks.wrapping_sub(due_ticks) as i32 >= 0;
        // Setting an alarm takes 2 µs.
        if is_past(self.now()) {
            return;
        }
        let alarm_ticks = due_ticks & COUNTER_MASK;
        CaptureInterrupt::unpend();
        wait_for_alarm(CAPTURE, alarm_ticks, || is_past(self.now())).await;
    }

    /// Takes in new edges. Returns false if some were lost: the task was held up for longer than the memory
    /// lasts.
    pub(super) fn fill(&mut self) -> bool {
        let left = |ring: usize| self.transfers[ring].get_remaining_transfers() as usize;
        self.edges.fill(|| CAPTURE.cnt().read(), left)
    }
}
