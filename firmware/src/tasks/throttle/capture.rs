//! The timer that captures the wire's edges: one of its channels takes the rising ones and another
//! the falling ones, each into a ring in memory by DMA, so that an edge costs no interrupt.
//!
//! A third channel is an alarm clock: the processor looks at the rings when a frame should be whole.

use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use core::task::Poll;

use embassy_stm32::dma;
use embassy_stm32::interrupt::typelevel::{Handler, Interrupt};
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, FilterValue};
use embassy_stm32::timer::GeneralInstance1Channel;
use embassy_sync::waitqueue::AtomicWaker;
use static_cell::StaticCell;

use super::ring::{LEN, Memory, Ring};
use crate::board::wire::{CAPTURE, CaptureTimer, PRESCALER, SIGNAL_CHANNEL, TICK_HZ, TIMER_BITS};

/// The alarm clock's channel; the edges have the first and the second.
const ALARM: usize = 2;

/// Bits of a DShot frame: so many edges of each direction.
const BITS: usize = 16;

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
    rings: [Ring; 2],
    last_ticks: u32,
    settled_ticks: u32,
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
        let ring = |index, channel, request| {
            let register = CAPTURE.ccr(index).as_ptr().cast();
            // SAFETY: the register is one of a timer that this owns for ever.
            unsafe { Ring::new(channel, request, register, &MEMORY[index]) }
        };
        let [first, second] = CHANNELS.init(channels);
        let rings = [ring(0, first, requests[0]), ring(1, second, requests[1])];
        CAPTURE.egr().write(|w| w.set_ug(true));
        CAPTURE.cr1().modify(|w| w.set_cen(true));
        // SAFETY: the handler touches nothing but the timer, and wakes a task.
        unsafe { <CaptureTimer as GeneralInstance1Channel>::CaptureCompareInterrupt::enable() };
        Self {
            rings,
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

    /// Takes in what has come. False if some were lost: the task was kept from its work for longer than
    /// the memory lasts.
    pub(super) fn fill(&mut self) -> bool {
        self.settled_ticks = self.now().wrapping_sub(SETTLED_TICKS);
        let [rising, falling] = &mut self.rings;
        rising.fill() & falling.fill()
    }

    /// An edge's time, by what the timer showed then.
    #[inline(always)]
    fn time(&self, shown: u32) -> u32 {
        let before_ticks = self.last_ticks.wrapping_sub(shown) & COUNTER_MASK;
        self.last_ticks.wrapping_sub(before_ticks)
    }

    /// The next edge of a direction.
    #[inline(always)]
    fn front(&self, direction: usize) -> Option<u32> {
        let ring = &self.rings[direction];
        (ring.count() > 0).then(|| self.time(ring.word(0)))
    }

    /// The first edge that has come.
    pub(super) fn first(&self) -> Option<u32> {
        let age = |ticks: &u32| self.settled_ticks.wrapping_sub(*ticks) as i32;
        let fronts = [self.front(0), self.front(1)];
        fronts.into_iter().flatten().max_by_key(age)
    }

    /// The first and the second edge of each of 16 bits, if as many edges have come as a frame has.
    #[inline(always)]
    pub(super) fn frame(&self) -> Option<impl Fn(usize) -> (u32, u32) + '_> {
        if !self.has_frame() {
            return None;
        }
        let [rising, falling] = &self.rings;
        let since = falling.word(0).wrapping_sub(rising.word(0)) & COUNTER_MASK;
        let (first, second) = if since <= COUNTER_MASK / 2 {
            (rising, falling)
        } else {
            (falling, rising)
        };
        let (first, second) = (first.words(), second.words());
        Some(move |bit| (self.time(first(bit)), self.time(second(bit))))
    }

    /// Whether as many edges have come as a frame has.
    pub(super) fn has_frame(&self) -> bool {
        self.rings.iter().all(|ring| ring.count() == BITS)
    }

    /// Whether this time was still to come at the last look.
    pub(super) fn is_before(&self, until_ticks: u32) -> bool {
        until_ticks.wrapping_sub(self.last_ticks) as i32 > 0
    }

    /// Leaves a frame's edges behind.
    pub(super) fn skip_frame(&mut self) {
        for ring in &mut self.rings {
            ring.skip(BITS);
        }
    }

    /// Gives out the edges that have come, with the level after each, in their order.
    pub(super) fn take(&mut self, mut give: impl FnMut(u32, bool)) {
        while let Some((at_ticks, level)) = self.next() {
            give(at_ticks, level);
        }
    }

    /// The time up to which [`Capture::take`] has given out every edge.
    pub(super) fn settled(&self) -> u32 {
        self.settled_ticks
    }

    /// The next edge of both directions. One that is too young waits: an older one of the other
    /// direction may still be on its way into memory.
    fn next(&mut self) -> Option<(u32, bool)> {
        let age = |ticks: u32| self.settled_ticks.wrapping_sub(ticks) as i32;
        let fronts = [self.front(0), self.front(1)];
        let [rising, falling] = fronts.map(|front| front.map(age));
        let level = rising > falling;
        let direction = usize::from(!level);
        if [rising, falling][direction]? < 0 {
            return None;
        }
        self.rings[direction].skip(1);
        Some((fronts[direction]?, level))
    }

    /// Forgets the edges that have come.
    pub(super) fn forget(&mut self) {
        for ring in &mut self.rings {
            ring.fill();
            ring.clear();
        }
    }
}
