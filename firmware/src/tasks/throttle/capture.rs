//! The timer that captures the wire's edges: one of its channels takes the rising ones and another
//! the falling ones, each into a ring in memory by DMA, so that an edge costs no interrupt.
//!
//! A third channel is an alarm clock: the processor looks at the rings when a frame should be whole.

use core::future::poll_fn;
use core::ptr;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use core::task::Poll;

use embassy_stm32::dma::{self, TransferOptions};
use embassy_stm32::interrupt::typelevel::{Handler, Interrupt};
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, FilterValue};
use embassy_stm32::timer::GeneralInstance1Channel;
use embassy_sync::waitqueue::AtomicWaker;
use static_cell::StaticCell;

use crate::board::wire::{CAPTURE, CaptureTimer, PRESCALER, SIGNAL_CHANNEL, TICK_HZ, TIMER_BITS};
use crate::edges::{Edges, LEN, Memory};

/// The alarm clock's channel; the edges have the first and the second.
const ALARM: usize = 2;

/// An edge that is younger may not be in memory yet: the DMA takes some ten clocks of its bus, and
/// more while it serves others. 0.5 µs.
const SETTLED_TICKS: u32 = TICK_HZ / 2_000_000;

/// The greatest value of the timer's counter.
const COUNTER_MASK: u32 = u32::MAX >> (32 - TIMER_BITS);

static WAKER: AtomicWaker = AtomicWaker::new();
/// True if it was an edge that woke the task.
static EDGE: AtomicBool = AtomicBool::new(false);

/// Ticks of a time.
pub(super) const fn ticks_of_us(time_us: u32) -> u32 {
    (TICK_HZ as u64 * time_us as u64 / 1_000_000) as u32
}

/// The capturing timer's interrupt: an edge after a quiet time, or the alarm.
pub(crate) struct CaptureInterrupt;

impl Handler<<CaptureTimer as GeneralInstance1Channel>::CaptureCompareInterrupt>
    for CaptureInterrupt
{
    unsafe fn on_interrupt() {
        let wanted = CAPTURE.dier().read();
        if !wanted.ccie(ALARM) {
            // An edge that came before the interrupts were off asks once more.
            return;
        }
        // The DMA has read the edge's time by now, and its flag went with that: what is left tells of
        // the alarm.
        let alarm = CAPTURE.sr().read().ccif(ALARM);
        let edges = wanted.ccie(0);
        if !alarm && !edges {
            // So does one that came before the alarm alone was waited for.
            return;
        }
        EDGE.store(edges && !alarm, Ordering::Relaxed);
        // Once is enough: the task says when it wants to be woken again.
        set_interrupts(false, false);
        WAKER.wake();
    }
}

/// The interrupts of the edges and of the alarm. Only while they are off does the task call this, and
/// only their handler while they are on.
fn set_interrupts(edges: bool, alarm: bool) {
    CAPTURE.dier().modify(|w| {
        for channel in 0..ALARM {
            w.set_ccie(channel, edges);
        }
        w.set_ccie(ALARM, alarm);
    });
}

/// Lets a channel, which is off, capture the pin's edges.
pub(crate) fn capture_on(channel: usize) {
    CAPTURE.ccmr_input(0).modify(|w| {
        // Both channels see the one pin: its own directly, its neighbour crosswise.
        w.set_ccs(
            channel,
            if channel == SIGNAL_CHANNEL {
                CcmrInputCcs::TI4
            } else {
                CcmrInputCcs::TI3
            },
        );
        // Four samples of the timer's own clock: spikes shorter than 24 ns (48 ns on the
        // F405) are nothing.
        w.set_icf(channel, FilterValue::FCK_INT_N4);
    });
}

/// The edges of the wire.
pub(crate) struct Capture {
    pub(super) edges: Edges<TIMER_BITS>,
    /// Of the rising ones' times, and of the falling ones', into memory.
    transfers: [dma::Transfer<'static>; 2],
}

impl Capture {
    /// Starts the timer, which belongs to this from now on, as do the DMA's channels: that of its
    /// first channel, and of its second. The pin leads to it.
    pub(crate) fn new(channels: [dma::Channel<'static>; 2], requests: [dma::Request; 2]) -> Self {
        static MEMORY: [Memory; 2] = [const { [const { AtomicU32::new(0) }; LEN] }; 2];
        static CHANNELS: StaticCell<[dma::Channel<'static>; 2]> = StaticCell::new();
        embassy_stm32::rcc::enable_and_reset::<CaptureTimer>();
        CAPTURE.psc().write_value(PRESCALER - 1);
        CAPTURE.arr().write_value(COUNTER_MASK);
        for channel in 0..2 {
            capture_on(channel);
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
            // SAFETY: the register is one of a timer that this owns for ever; the memory stays where it is and
            // may change behind a shared reference.
            unsafe { channel.read_raw(requests[index], register, words, options) }
        };
        let [first, second] = CHANNELS.init(channels);
        let transfers = [transfer(0, first), transfer(1, second)];
        CAPTURE.egr().write(|w| w.set_ug(true));
        CAPTURE.cr1().modify(|w| w.set_cen(true));
        // SAFETY: the handler touches nothing but the timer, and wakes a task.
        unsafe { <CaptureTimer as GeneralInstance1Channel>::CaptureCompareInterrupt::enable() };
        Self {
            edges: Edges::new(MEMORY.each_ref(), SETTLED_TICKS),
            transfers,
        }
    }
}

impl Capture {
    /// The time, as [`Edges::now`] has it.
    pub(super) fn now(&mut self) -> u32 {
        self.edges.now(CAPTURE.cnt().read())
    }

    /// Waits for an edge, until a time at most. Returns true if one came.
    pub(super) async fn wait_for_edge(&mut self, due_ticks: u32) -> bool {
        EDGE.store(false, Ordering::Relaxed);
        // An edge that came before is in the rings: the flags tell of new ones.
        CAPTURE.sr().write(|w| {
            // Zeros clear, ones leave.
            w.0 = !0;
            for channel in 0..ALARM {
                w.set_ccif(channel, false);
            }
        });
        self.wait(due_ticks, true).await;
        EDGE.load(Ordering::Relaxed)
    }

    /// Waits until a time.
    pub(super) async fn wait_until(&mut self, due_ticks: u32) {
        self.wait(due_ticks, false).await;
    }

    async fn wait(&mut self, due_ticks: u32, edges: bool) {
        CAPTURE.ccr(ALARM).write_value(due_ticks & COUNTER_MASK);
        CAPTURE.sr().write(|w| {
            w.0 = !0;
            w.set_ccif(ALARM, false);
        });
        let mut begun = false;
        poll_fn(|context| {
            WAKER.register(context.waker());
            if !core::mem::replace(&mut begun, true) {
                set_interrupts(edges, true);
            }
            let is_off = !CAPTURE.dier().read().ccie(ALARM);
            // The alarm may have been set too late to ring.
            let is_past = self.now().wrapping_sub(due_ticks) as i32 >= 0;
            if is_off || is_past {
                set_interrupts(false, false);
                Poll::Ready(())
            } else {
                Poll::Pending
            }
        })
        .await;
    }

    /// Takes in what has come. False if some were lost: the task was kept from its work for longer than
    /// the memory lasts.
    pub(super) fn fill(&mut self) -> bool {
        let left = |ring: usize| self.transfers[ring].get_remaining_transfers() as usize;
        self.edges.fill(|| CAPTURE.cnt().read(), left)
    }
}
