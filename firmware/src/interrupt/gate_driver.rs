//! The gate driver: what it says of itself, and when the bridge may be turned on.
//!
//! A DRV8301 turns its gates off by itself and pulls nFAULT low. The pin's interrupt ([`alarm`])
//! then turns the bridge off and the driver with it; the PWM interrupt reads the pin too, each
//! period, and lets the driver come up again when some time has passed.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::pac::gpio::Gpio;
use embassy_stm32::pac::gpio::vals::Idr;

use crate::board::GATE_DRIVER;

/// The pins of a gate driver on its port.
#[derive(Clone, Copy)]
pub(crate) struct Pins {
    /// Enables it, high.
    pub(crate) enable: usize,
    /// Its alarm, low.
    pub(crate) fault: usize,
}

/// Control periods for which it rests after an alarm: 11 ms at the fastest PWM, 80 ms at the slowest.
const REST_PERIODS: u16 = 640;

/// Control periods before the end of the rest at which it is enabled again. It takes up to 10 ms, and
/// says that all is not well until then.
const WAKE_PERIODS: u16 = 620;

/// Whether the alarm's interrupt has turned the driver off since the last period.
static ALARMED: AtomicBool = AtomicBool::new(false);

/// The gate driver as the PWM interrupt knows it. A board without one is always ready.
pub(crate) struct GateDriver {
    port: Gpio,
    rest_periods: u16,
}

impl GateDriver {
    /// A driver that is enabled.
    pub(crate) fn new(port: Gpio) -> Self {
        Self {
            port,
            rest_periods: 0,
        }
    }

    /// Whether the bridge may be turned on.
    #[inline(always)]
    pub(crate) fn ready(&mut self) -> bool {
        let Some(pins) = GATE_DRIVER else {
            return true;
        };
        let alarm = self.port.idr().read().idr(pins.fault) == Idr::LOW;
        if self.rest_periods == 0 && !alarm && !ALARMED.load(Ordering::Relaxed) {
            return true;
        }
        self.rest(pins, alarm);
        false
    }

    #[cold]
    #[inline(never)]
    fn rest(&mut self, pins: Pins, alarm: bool) {
        if ALARMED.load(Ordering::Relaxed) || self.rest_periods == 0 {
            ALARMED.store(false, Ordering::Relaxed);
            disable(self.port, pins);
            self.rest_periods = REST_PERIODS;
        }
        self.rest_periods -= 1;
        if self.rest_periods == WAKE_PERIODS {
            self.port.bsrr().write(|w| w.set_bs(pins.enable, true));
        } else if self.rest_periods == 0 && alarm {
            // What has come up with an alarm is tried again and again: its cause may end.
            disable(self.port, pins);
            self.rest_periods = REST_PERIODS;
        }
    }
}

fn disable(port: Gpio, pins: Pins) {
    port.bsrr().write(|w| w.set_br(pins.enable, true));
}

/// The gate driver's alarm: the bridge off, the driver off.
#[cfg(feature = "vesc4-f405")]
pub(crate) fn alarm(registers: super::Registers) {
    super::pwm::turn_off(registers.timer);
    if let Some(pins) = GATE_DRIVER {
        disable(registers.gate_driver, pins);
    }
    ALARMED.store(true, Ordering::Relaxed);
}
