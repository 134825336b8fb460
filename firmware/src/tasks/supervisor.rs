//! The watchdog, fed only by proof of life from the control's interrupt, from the throttle's task and
//! from the other tasks: if one of them stands still, the chip starts anew, and the bridge is off. An
//! interrupt that stands still is not waited for that long.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Ticker};

use crate::interrupt;
use crate::last_words::{DETAILS, Failure, fail};

/// Who must show that it lives.
#[derive(Clone, Copy)]
pub(crate) enum Task {
    /// The throttle's.
    Throttle,
    /// That with MAVLink and storage.
    Mavlink,
}

static LIFE: [AtomicU32; 2] = [const { AtomicU32::new(0) }; 2];

/// Shows that a task lives; each does so within [`LOOK`].
pub(crate) fn lives(task: Task) {
    LIFE[task as usize].fetch_add(1, Ordering::Relaxed);
}

/// How often they are looked at.
const LOOK: Duration = Duration::from_millis(50);

/// Feeds the watchdog as long as all live.
#[embassy_executor::task]
pub(crate) async fn supervise(mut watchdog: IndependentWatchdog<'static, IWDG>) -> ! {
    watchdog.unleash();
    let mut ticker = Ticker::every(LOOK);
    let (mut periods, mut tasks) = (interrupt::periods(), proofs());
    loop {
        ticker.next().await;
        // The bridge would keep its last duties until the watchdog's time is over.
        if interrupt::periods() == periods {
            fail(Failure::Standstill, [0; DETAILS]);
        }
        periods = interrupt::periods();
        let now = proofs();
        if now.iter().zip(tasks).all(|(now, before)| *now != before) {
            watchdog.pet();
            tasks = now;
        }
    }
}

fn proofs() -> [u32; 2] {
    LIFE.each_ref().map(|count| count.load(Ordering::Relaxed))
}
