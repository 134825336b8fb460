//! The timer that captures the wire's edges: one of its channels takes the rising ones and another
//! the falling ones, each into a ring in memory by DMA, so that an edge costs no interrupt.
//!
//! A third channel is an alarm clock: the processor looks at the rings when a frame should be whole.

use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::Poll;

use embassy_stm32::dma::{self, ReadableRingBuffer, TransferOptions};
use embassy_stm32::interrupt::typelevel::{Handler, Interrupt};
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, FilterValue};
use embassy_stm32::timer::GeneralInstance1Channel;
use embassy_sync::waitqueue::AtomicWaker;
use heapless::Deque;
use static_cell::StaticCell;

use crate::board::wire::{CAPTURE, CaptureTimer, PRESCALER, SIGNAL_CHANNEL, TICK_HZ, TIMER_BITS};

/// Edges of one direction that the memory takes between two looks: two DShot frames.
const RING_LEN: usize = 32;

/// The alarm clock's channel; the edges have the first and the second.
const ALARM: usize = 2;

/// An edge that is younger may not be in memory yet: the DMA takes some ten clocks of its bus, and
/// more while it serves others. 0.5 µs.
const SETTLED_TICKS: u32 = TICK_HZ / 2_000_000;

/// What the timer's counter can show.
const COUNTER_MASK: u32 = u32::MAX >> (32 - TIMER_BITS);

static WAKER: AtomicWaker = AtomicWaker::new();
/// Whether an edge was what woke.
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
        EDGE.store(wanted.ccie(0) && !alarm, Ordering::Relaxed);
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

/// The edges of the wire.
pub(crate) struct Capture {
    /// Rising, falling.
    rings: [ReadableRingBuffer<'static, u32>; 2],
    /// Edges that have been read from the rings and not given out yet.
    held: [Deque<u32, RING_LEN>; 2],
    last_ticks: u32,
    settled_ticks: u32,
}

impl Capture {
    /// Starts the timer, which belongs to this from now on, as do the DMA's channels: that of its
    /// first channel, and of its second. The pin leads to it.
    pub(crate) fn new(channels: [dma::Channel<'static>; 2], requests: [dma::Request; 2]) -> Self {
        static MEMORY: StaticCell<[[u32; RING_LEN]; 2]> = StaticCell::new();
        let [rising, falling] = MEMORY.init([[0; RING_LEN]; 2]);
        embassy_stm32::rcc::enable_and_reset::<CaptureTimer>();
        CAPTURE.psc().write_value(PRESCALER - 1);
        CAPTURE.arr().write_value(COUNTER_MASK);
        CAPTURE.ccmr_input(0).modify(|w| {
            for channel in 0..2 {
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
            }
        });
        CAPTURE.ccer().modify(|w| {
            w.set_ccp(1, true);
            w.set_cce(0, true);
            w.set_cce(1, true);
        });
        CAPTURE.dier().modify(|w| {
            w.set_ccde(0, true);
            w.set_ccde(1, true);
        });
        let ring = |index, channel, request, memory: &'static mut [u32; RING_LEN]| {
            let register = CAPTURE.ccr(index).as_ptr();
            // SAFETY: the register is one of a timer that this owns, and the ring has its memory
            // for ever.
            let mut ring = unsafe {
                ReadableRingBuffer::new(
                    channel,
                    request,
                    register.cast(),
                    memory,
                    TransferOptions::default(),
                )
            };
            ring.start();
            ring
        };
        let [first, second] = channels;
        let rings = [
            ring(0, first, requests[0], rising),
            ring(1, second, requests[1], falling),
        ];
        CAPTURE.egr().write(|w| w.set_ug(true));
        CAPTURE.cr1().modify(|w| w.set_cen(true));
        // SAFETY: the handler touches nothing but the timer, and wakes a task.
        unsafe { <CaptureTimer as GeneralInstance1Channel>::CaptureCompareInterrupt::enable() };
        Self {
            rings,
            held: [Deque::new(), Deque::new()],
            last_ticks: 0,
            settled_ticks: 0,
        }
    }
}

impl Capture {
    /// The time of the timer, which wraps after 32 bits. A timer with fewer is extended: this must be
    /// called within each of its turns.
    pub(super) fn now(&mut self) -> u32 {
        let passed = CAPTURE.cnt().read().wrapping_sub(self.last_ticks) & COUNTER_MASK;
        self.last_ticks = self.last_ticks.wrapping_add(passed);
        self.last_ticks
    }

    /// Waits for an edge, until a time at most; whether one came.
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

    /// Gives out the edges that have come, with the level after each, in their order. False if some
    /// were lost: the task was kept from its work for longer than the memory lasts.
    pub(super) fn take(&mut self, mut give: impl FnMut(u32, bool)) -> bool {
        let now_ticks = self.now();
        self.settled_ticks = now_ticks.wrapping_sub(SETTLED_TICKS);
        let mut whole = true;
        for (ring, held) in self.rings.iter_mut().zip(&mut self.held) {
            let mut times = [0; RING_LEN];
            let Ok((count, _)) = ring.read(&mut times) else {
                whole = false;
                held.clear();
                continue;
            };
            for ticks in &times[..count] {
                let before_ticks = now_ticks.wrapping_sub(*ticks) & COUNTER_MASK;
                whole &= held.push_back(now_ticks.wrapping_sub(before_ticks)).is_ok();
            }
        }
        while let Some((at_ticks, level)) = self.next() {
            give(at_ticks, level);
        }
        whole
    }

    /// The time up to which [`Capture::take`] has given out every edge.
    pub(super) fn settled(&self) -> u32 {
        self.settled_ticks
    }

    /// The next edge of both directions. One that is too young waits: an older one of the other
    /// direction may still be on its way into memory.
    fn next(&mut self) -> Option<(u32, bool)> {
        let [rising, falling] = &self.held;
        let age = |ticks: &u32| self.settled_ticks.wrapping_sub(*ticks) as i32;
        let ages = [rising.front().map(age), falling.front().map(age)];
        let level = ages[0] > ages[1];
        if ages[usize::from(!level)]? < 0 {
            return None;
        }
        let ticks = self.held[usize::from(!level)].pop_front()?;
        Some((ticks, level))
    }

    /// Forgets the edges that have come.
    pub(super) fn forget(&mut self) {
        for (ring, held) in self.rings.iter_mut().zip(&mut self.held) {
            ring.clear();
            held.clear();
        }
    }
}
