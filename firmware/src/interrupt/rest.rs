//! Recovery of a gate driver after an alarm: it sleeps, wakes, and its alarm counts again only once it has had
//! time to come up.

/// Control periods of rest after an alarm: 11 ms at the fastest PWM, 80 ms at the slowest.
const REST_PERIODS: u16 = 640;

/// Control periods before the end of the rest at which it is enabled again. It takes up to 10 ms, and signals
/// an alarm until then.
const WAKE_PERIODS: u16 = 620;

/// What to do with the driver in a period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// Disable it, and mask its alarm's interrupt.
    Sleep,
    /// Nothing: it sleeps, or comes up.
    Wait,
    /// Enable it. Its alarm is still masked: every driver gives one while coming up.
    Wake,
    /// It is well: unmask its alarm.
    Listen,
}

/// The rest after an alarm.
#[derive(Debug, Default)]
pub(crate) struct Rest {
    periods: u16,
}

impl Rest {
    /// Returns true if no rest is in progress.
    pub(crate) fn is_over(&self) -> bool {
        self.periods == 0
    }

    /// Advances a rest by a period, or starts one after an alarm. `alarm` is the line's level.
    pub(crate) fn step(&mut self, alarm: bool) -> Order {
        if self.is_over() {
            self.periods = REST_PERIODS;
            return Order::Sleep;
        }
        self.periods -= 1;
        match self.periods {
            WAKE_PERIODS => Order::Wake,
            // Retry a driver that comes up with an alarm for as long as it takes: the cause may end.
            0 if alarm => {
                self.periods = REST_PERIODS;
                Order::Sleep
            }
            0 => Order::Listen,
            _ => Order::Wait,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A driver as in its data sheet: nFAULT is low while it comes up, which takes 10 ms at 60 kHz, and while
    /// it has a reason.
    struct Driver {
        enabled: bool,
        awake_periods: u16,
        reason: bool,
        heard: bool,
        low: bool,
        alarms: u32,
    }

    impl Driver {
        const COMES_UP_PERIODS: u16 = 600;

        /// A driver that gives an alarm after having been well.
        fn alarmed() -> Self {
            Self {
                enabled: true,
                awake_periods: Self::COMES_UP_PERIODS,
                reason: true,
                heard: true,
                low: false,
                alarms: 0,
            }
        }

        /// Advances a period. Returns true if its alarm's interrupt has come.
        fn period(&mut self) -> bool {
            self.awake_periods = if self.enabled {
                self.awake_periods + 1
            } else {
                0
            };
            let comes_up = self.enabled && self.awake_periods < Self::COMES_UP_PERIODS;
            let low = self.enabled && self.reason || comes_up;
            let edge = low && !self.low;
            self.low = low;
            if edge && self.heard {
                // As the interrupt does.
                self.enabled = false;
                self.alarms += 1;
            }
            edge && self.heard
        }

        /// Runs both; returns after how many periods the bridge may be on.
        fn ready(&mut self, rest: &mut Rest, periods: u32) -> Option<u32> {
            (0..periods).find(|_| {
                let alarmed = self.period();
                if rest.is_over() && !self.low && !alarmed {
                    return true;
                }
                match rest.step(self.low) {
                    Order::Sleep => (self.enabled, self.heard) = (false, false),
                    Order::Wake => self.enabled = true,
                    Order::Listen => self.heard = true,
                    Order::Wait => {}
                }
                false
            })
        }
    }

    #[test]
    fn a_driver_whose_reason_has_ended_is_back_after_one_rest() {
        let (mut driver, mut rest) = (Driver::alarmed(), Rest::default());
        assert_eq!(driver.ready(&mut rest, 10), None);
        driver.reason = false;
        let periods = driver.ready(&mut rest, 10_000).expect("it comes back");
        assert!(periods <= u32::from(REST_PERIODS) + 1, "{periods}");
        assert_eq!(driver.alarms, 1, "none by coming up");
        // The next one is heard.
        driver.reason = true;
        assert_eq!(driver.ready(&mut rest, 2), None);
        assert_eq!(driver.alarms, 2);
        assert!(!driver.enabled);
    }

    #[test]
    fn a_reason_that_stays_keeps_the_bridge_off_and_is_tried_again() {
        let (mut driver, mut rest) = (Driver::alarmed(), Rest::default());
        assert_eq!(driver.ready(&mut rest, 5_000), None);
        driver.reason = false;
        assert!(driver.ready(&mut rest, 1_300).is_some());
    }
}
