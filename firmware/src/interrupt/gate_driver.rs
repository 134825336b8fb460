//! The gate driver: its alarm, and when the bridge may be turned on.
//!
//! A DRV8302 turns its gates off by itself and pulls nFAULT low. The pin's interrupt then turns off the bridge
//! and the driver; the PWM interrupt also reads the pin every period, and lets the driver come up again after a
//! while. Until then the pin's interrupt is masked, since a driver that comes up pulls nFAULT low as well.

use core::sync::atomic::{AtomicBool, Ordering};

#[cfg(feature = "stm32f405")]
use embassy_stm32::interrupt;
use embassy_stm32::pac::EXTI;
use embassy_stm32::pac::gpio::Gpio;
use embassy_stm32::pac::gpio::vals::Idr;

#[cfg(feature = "stm32f405")]
use super::registers::Registers;
use super::rest::{Order, Rest};
use crate::board::GATE_DRIVER;
use crate::board::wiring::GateDriverPins;
#[cfg(feature = "stm32f405")]
use crate::{
    chip::{self, bridge::turn_off},
    priority,
};

/// The alarm's interrupt has turned the driver off since the last period.
static ALARMED: AtomicBool = AtomicBool::new(false);

/// The gate driver, as the PWM interrupt sees it. A board without one is always ready.
pub(crate) struct GateDriver {
    port: Gpio,
    rest: Rest,
}

impl GateDriver {
    /// Creates an enabled driver.
    pub(crate) fn new(port: Gpio) -> Self {
        Self {
            port,
            rest: Rest::default(),
        }
    }

    /// Returns true if the bridge may be turned on.
    #[inline(always)] // in each period
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
    #[inline(never)] // only with an alarm
    fn attend(&mut self, pins: GateDriverPins, alarm: bool) {
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

/// Unmasks or masks the interrupt of the alarm line's falling edge. No other EXTI line is used.
fn hear(pins: GateDriverPins, hears: bool) {
    // Do not report a masked alarm later: the level is read every period.
    EXTI.pr(0).write(|w| w.set_line(pins.fault, true));
    EXTI.imr(0).modify(|w| w.set_line(pins.fault, hears));
}

fn disable(port: Gpio, pins: GateDriverPins) {
    port.bsrr().write(|w| w.set_br(pins.enable, true));
}

/// Enables the alarm's interrupt at priority 1: not even the tasks' critical sections hold it up.
#[cfg(feature = "stm32f405")]
pub(super) fn begin() {
    let Some(pins) = GATE_DRIVER else {
        return;
    };
    chip::detect(pins.fault);
    hear(pins, true);
    priority::set(chip::ALARM as usize, priority::ALARM);
    // SAFETY: everything the handler needs is in place, and no critical section relies on masking it.
    unsafe { cortex_m::peripheral::NVIC::unmask(chip::ALARM) };
}

/// nFAULT: turns off the bridge and the driver.
#[cfg(feature = "stm32f405")]
#[interrupt]
#[unsafe(link_section = ".control")]
fn EXTI15_10() {
    let registers = Registers::CHIP;
    turn_off(registers.timer);
    if let Some(pins) = GATE_DRIVER {
        disable(registers.port_c, pins);
        ALARMED.store(true, Ordering::Relaxed);
        chip::heard(pins.fault);
    }
}
