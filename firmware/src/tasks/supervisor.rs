//! The watchdog, fed only by proof of life from the control's interrupt and from the throttle's task,
//! in the task that attends to the rest: if one of them stops, the chip restarts, and the
//! bridge is off. An interrupt that stops is noticed sooner.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Instant};

use crate::interrupt;
use crate::last_words::{DETAILS, Failure, fail};

/// The watchdog outlasts the longest that the tasks are held up: the erase of a sector, at most 0.8 s
/// (DS8626, table 40), and as much again.
const WATCHDOG_US: u32 = 1_600_000;

/// Time between two looks at the others; each shows within it that it lives.
const LOOK: Duration = Duration::from_millis(50);

static THROTTLE: AtomicU32 = AtomicU32::new(0);

/// Shows that the throttle's task lives.
pub(crate) fn throttle_lives() {
    THROTTLE.fetch_add(1, Ordering::Relaxed);
}

/// The state of the task that feeds the watchdog.
pub(crate) struct Supervisor {
    watchdog: IndependentWatchdog<'static, IWDG>,
    due: Instant,
    periods: u32,
    throttle: u32,
}

impl Supervisor {
    /// Starts the watchdog.
    pub(crate) fn new(watchdog: Peri<'static, IWDG>) -> Self {
        let mut watchdog = IndependentWatchdog::new(watchdog, WATCHDOG_US);
        watchdog.unleash();
        Self {
            watchdog,
            // The first look takes all to live: no count has come that far.
            due: Instant::MIN,
            periods: u32::MAX,
            throttle: u32::MAX,
        }
    }

    /// Feeds the watchdog when it is due, as long as all live.
    pub(crate) fn look(&mut self, now: Instant) {
        if now < self.due {
            return;
        }
        self.due = now + LOOK;
        let periods = interrupt::periods();
        // The bridge would keep its last duties until the watchdog's time is over.
        if periods == self.periods {
            fail(Failure::Standstill, [0; DETAILS]);
        }
        self.periods = periods;
        let throttle = THROTTLE.load(Ordering::Relaxed);
        if throttle != self.throttle {
            self.watchdog.pet();
            self.throttle = throttle;
        }
    }
}
