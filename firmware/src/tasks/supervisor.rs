//! Feeds the watchdog, from the main task, only while the control interrupt and the throttle task prove that
//! they are alive: if one stops, the chip restarts with the bridge off. A stopped interrupt is noticed sooner.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_stm32::Peri;
use embassy_stm32::peripherals::IWDG;
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Instant};

use crate::interrupt;
use crate::last_words::{DETAILS, Failure, fail};

/// The watchdog's period: twice the longest that the tasks are held up, which is the erase of a sector, at most
/// 0.8 s (DS8626, table 40).
const WATCHDOG_US: u32 = 1_600_000;

/// Time between two looks at the others; each must show a sign of life within it.
const LOOK: Duration = Duration::from_millis(50);

static THROTTLE: AtomicU32 = AtomicU32::new(0);

/// Shows that the throttle task is alive.
pub(crate) fn throttle_lives() {
    THROTTLE.fetch_add(1, Ordering::Relaxed);
}

/// State of the task that feeds the watchdog.
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
            // The first look finds everything alive: no count is this high yet.
            due: Instant::MIN,
            periods: u32::MAX,
            throttle: u32::MAX,
        }
    }

    /// Feeds the watchdog when due, as long as everything is alive.
    pub(crate) fn poll(&mut self, now: Instant) {
        if now < self.due {
            return;
        }
        self.due = now + LOOK;
        let periods = interrupt::periods();
        // Otherwise the bridge would keep its last duties until the watchdog's period is over.
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
