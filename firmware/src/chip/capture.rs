//! A timer that captures a wire's edges, the rising ones by one channel and the falling ones by another, and
//! wakes a task: at an edge after a quiet time, or, by a third channel, as an alarm clock.

use core::future::poll_fn;
use core::mem;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::Poll;

use embassy_stm32::pac::timer::TimGp32;
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, FilterValue};
use embassy_sync::waitqueue::AtomicWaker;

/// The alarm clock's channel; the edges have the first and the second.
const ALARM: usize = 2;

static WAKER: AtomicWaker = AtomicWaker::new();
/// True if it was an edge that woke the task.
static EDGE: AtomicBool = AtomicBool::new(false);

/// The timer's interrupt.
#[inline(always)] // one caller
pub(crate) fn attend(timer: TimGp32) {
    let wanted = timer.dier().read();
    if !wanted.ccie(ALARM) {
        // An edge that came before the interrupts were off asks once more.
        return;
    }
    // The DMA has read the edge's time by now, and its flag went with that: what is left tells of
    // the alarm.
    let alarm = timer.sr().read().ccif(ALARM);
    let edges = wanted.ccie(0);
    if !alarm && !edges {
        // So does one that came before the alarm alone was waited for.
        return;
    }
    EDGE.store(edges && !alarm, Ordering::Relaxed);
    // Once is enough: the task says when it wants to be woken again.
    set_interrupts(timer, false, false);
    WAKER.wake();
}

/// The interrupts of the edges and of the alarm. Only while they are off does the task call this, and
/// only their handler while they are on.
fn set_interrupts(timer: TimGp32, edges: bool, alarm: bool) {
    timer.dier().modify(|w| {
        for channel in 0..ALARM {
            w.set_ccie(channel, edges);
        }
        w.set_ccie(ALARM, alarm);
    });
}

/// Lets a channel, which is off, capture the edges of the pin that is a channel's own.
pub(crate) fn capture_on(timer: TimGp32, channel: usize, pin_channel: usize) {
    timer.ccmr_input(0).modify(|w| {
        // Both channels see the one pin: its own directly, its neighbour crosswise.
        w.set_ccs(
            channel,
            if channel == pin_channel {
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

/// Waits for an edge. Returns true if one came before the alarm.
pub(crate) async fn wait_for_edge(
    timer: TimGp32,
    alarm_ticks: u32,
    is_past: impl FnMut() -> bool,
) -> bool {
    EDGE.store(false, Ordering::Relaxed);
    // An edge that came before has been captured: the flags tell of new ones.
    timer.sr().write(|w| {
        // Zeros clear, ones leave.
        w.0 = !0;
        for channel in 0..ALARM {
            w.set_ccif(channel, false);
        }
    });
    wait(timer, alarm_ticks, true, is_past).await;
    EDGE.load(Ordering::Relaxed)
}

/// Waits for the alarm.
pub(crate) async fn wait_for_alarm(
    timer: TimGp32,
    alarm_ticks: u32,
    is_past: impl FnMut() -> bool,
) {
    wait(timer, alarm_ticks, false, is_past).await;
}

async fn wait(timer: TimGp32, alarm_ticks: u32, edges: bool, mut is_past: impl FnMut() -> bool) {
    timer.ccr(ALARM).write_value(alarm_ticks);
    timer.sr().write(|w| {
        w.0 = !0;
        w.set_ccif(ALARM, false);
    });
    let mut begun = false;
    poll_fn(|context| {
        WAKER.register(context.waker());
        if !mem::replace(&mut begun, true) {
            set_interrupts(timer, edges, true);
        }
        let is_off = !timer.dier().read().ccie(ALARM);
        // The alarm may have been set too late to ring.
        if is_off || is_past() {
            set_interrupts(timer, false, false);
            Poll::Ready(())
        } else {
            Poll::Pending
        }
    })
    .await;
}
