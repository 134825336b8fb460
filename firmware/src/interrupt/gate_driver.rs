//! The gate driver: its alarm, and when the bridge may be turned on.
//!
//! A DRV8302 turns its gates off by itself and pulls nFAULT low. The pin's interrupt ([`alarm`])
//! then turns the bridge off and the driver with it; the PWM interrupt reads the pin too, each
//! period, and lets the driver come up again when some time has passed. Until then the pin's interrupt
//! is masked: a driver that comes up pulls nFAULT low as well.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::pac::EXTI;
use embassy_stm32::pac::gpio::Gpio;
use embassy_stm32::pac::gpio::vals::Idr;

use super::rest::{Order, Rest};
use crate::board::GATE_DRIVER;
#[cfg(feature = "vesc4-f405")]
use crate::chip::bridge::turn_off;

/// The pins of a gate driver on its port.
#[derive(Clone, Copy)]
pub(crate) struct Pins {
    /// Enables it, high.
    pub(crate) enable: usize,
    /// Its alarm, low.
    pub(crate) fault: usize,
}

/// True if the alarm's interrupt has turned the driver off since the last period.
static ALARMED: AtomicBool = AtomicBool::new(false);

/// The gate driver as the PWM interrupt knows it. A board without one is always ready.
pub(crate) struct GateDriver {
    port: Gpio,
    rest: Rest,
}

impl GateDriver {
    /// A driver that is enabled.
    pub(crate) fn new(port: Gpio) -> Self {
        Self {
            port,
            rest: Rest::default(),
        }
    }

    /// Returns true if the bridge may be turned on.
    #[inline(always)]
    pub(crate) fn ready(&mut self) -> bool {
        let Some(pins) = GATE_DRIVER else {
            return true;
        };
        let alarm = self.port.idr().read().idr(pins.fault) == Idr::LOW;
        if self.rest.is_over() && !alarm && !ALARMED.load(Ordering::Relaxed) {
            return true;
        }
        self.attend(pins, alarm);
        false
    }

    #[cold]
    #[inline(never)]
    fn attend(&mut self, pins: Pins, alarm: bool) {
        match self.rest.step(alarm) {
            Order::Sleep => {
                hear(pins, false);
                disable(self.port, pins);
            }
            Order::Wait => {}
            Order::Wake => self.port.bsrr().write(|w| w.set_bs(pins.enable, true)),
            Order::Listen => {
                ALARMED.store(false, Ordering::Relaxed);
                hear(pins, true);
            }
        }
    }
}

/// Lets a falling edge of the alarm's line ask for its interrupt from now on, or no more. This line is
/// the only one of EXTI that is used.
pub(crate) fn hear(pins: Pins, hears: bool) {
    // An alarm that was masked is not reported later: the level is read each period.
    EXTI.pr(0).write(|w| w.set_line(pins.fault, true));
    EXTI.imr(0).modify(|w| w.set_line(pins.fault, hears));
}

fn disable(port: Gpio, pins: Pins) {
    port.bsrr().write(|w| w.set_br(pins.enable, true));
}

/// The gate driver's alarm: the bridge off, the driver off.
#[cfg(feature = "vesc4-f405")]
pub(crate) fn alarm(registers: super::Registers) {
    turn_off(registers.timer);
    if let Some(pins) = GATE_DRIVER {
        disable(registers.gate_driver, pins);
    }
    ALARMED.store(true, Ordering::Relaxed);
}
