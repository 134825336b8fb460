//! A timer that captures a wire's edges, rising on one channel and falling on another, and wakes a task: at an
//! edge after a quiet time or, by a third channel, at an alarm time.

use core::future::poll_fn;
use core::mem;
use core::sync::atomic::{AtomicBool, Ordering};
use core::task::Poll;

use embassy_stm32::pac::timer::TimGp32;
use embassy_stm32::pac::timer::vals::CcmrInputCcs;
use embassy_sync::waitqueue::AtomicWaker;

use super::EDGE_FILTER;

/// The alarm's channel; edges use the first and second.
const ALARM: usize = 2;

static WAKER: AtomicWaker = AtomicWaker::new();
/// An edge woke the task.
static EDGE: AtomicBool = AtomicBool::new(false);

/// Handles the timer's interrupt.
#[inline(always)] // one caller
pub(crate) fn attend(timer: TimGp32) {
    let wanted = timer.dier().read();
    if !wanted.ccie(ALARM) {
        // Pended by an edge before the interrupts were disabled.
        return;
    }
    // By now the DMA has read the edge's time, which cleared its flag: what is left is the alarm's.
    let alarm = timer.sr().read().ccif(ALARM);
    EDGE.store(!alarm, Ordering::Relaxed);
    // Once is enough: the task re-enables them when it wants to be woken again.
    set_interrupts(timer, false, false);
    WAKER.wake();
}

/// Enables or disables the interrupts of edges and alarm. The task calls this only while they are disabled, and
/// their handler only while they are enabled.
fn set_interrupts(timer: TimGp32, edges: bool, alarm: bool) {
    timer.dier().modify(|w| {
        for channel in 0..ALARM {
            w.set_ccie(channel, edges);
        }
        w.set_ccie(ALARM, alarm);
    });
}

/// Sets a disabled channel to capture the edges of the pin of `pin_channel`.
pub(crate) fn capture_on(timer: TimGp32, channel: usize, pin_channel: usize) {
    timer.ccmr_input(0).modify(|w| {
        // Both channels use the one pin: its own channel directly, the neighbour crossed over.
        w.set_ccs(
            channel,
            if channel == pin_channel {
                CcmrInputCcs::TI4
            } else {
                CcmrInputCcs::TI3
            },
        );
        w.set_icf(channel, EDGE_FILTER);
    });
}

/// Waits for an edge. Returns true if one came before the alarm. The interrupt must not be pending.
pub(crate) async fn wait_for_edge(
    timer: TimGp32,
    alarm_ticks: u32,
    is_past: impl FnMut() -> bool,
) -> bool {
    EDGE.store(false, Ordering::Relaxed);
    // Earlier edges have been captured: from here on the flags stand for new ones.
    timer.sr().write(|w| {
        // Writing 0 clears, 1 leaves unchanged.
        w.0 = !0;
        for channel in 0..ALARM {
            w.set_ccif(channel, false);
        }
    });
    wait(timer, alarm_ticks, true, is_past).await;
    EDGE.load(Ordering::Relaxed)
}

/// Waits for the alarm. The interrupt must not be pending.
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
        // The alarm may have been set too late to fire.
        if is_off || is_past() {
            set_interrupts(timer, false, false);
            Poll::Ready(())
        } else {
            Poll::Pending
        }
    })
    .await;
}
