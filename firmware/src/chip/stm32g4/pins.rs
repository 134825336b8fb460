//! Pins with a fixed function, set up once.

use embassy_stm32::pac;
use embassy_stm32::pac::gpio::Gpio;
use embassy_stm32::pac::gpio::vals::{Moder, Ospeedr, Pupdr};

/// What a pin is used for. Pins not set up stay analogue, as after reset.
#[derive(Clone, Copy)]
pub(crate) enum Use {
    /// Gate signal by this alternate function: fastest edges, and pulled down so that the gate is off while
    /// nothing drives it.
    Gate(u8),
    /// Output, always low.
    Low,
    /// Input with pull-up.
    PulledUp,
}

/// A port. The PAC's ports are addresses, which cannot be compared in a constant.
#[derive(Clone, Copy)]
pub(crate) enum Port {
    A,
    B,
    C,
}

impl Port {
    fn registers(self) -> Gpio {
        match self {
            Self::A => pac::GPIOA,
            Self::B => pac::GPIOB,
            Self::C => pac::GPIOC,
        }
    }
}

/// A port, a pin number in it, and the pin's use.
pub(crate) type Pin = (Port, u8, Use);

/// Returns true if every pin and its alternate function exist and no pin appears twice.
pub(crate) const fn exist_once(pins: &[Pin]) -> bool {
    let mut named = [0_u16; 3];
    let mut at = 0;
    while at < pins.len() {
        let (port, number, for_what) = pins[at];
        if number > 15 || matches!(for_what, Use::Gate(16..)) {
            return false;
        }
        let port = port as usize;
        if named[port] & 1 << number != 0 {
            return false;
        }
        named[port] |= 1 << number;
        at += 1;
    }
    true
}

/// Sets up pins. The mode comes last, so that no pin does anything else in between.
pub(crate) fn set_up(pins: &[Pin]) {
    for &(port, number, for_what) in pins {
        let port = port.registers();
        let pin = usize::from(number % 16);
        let (mode, pull) = match for_what {
            Use::Gate(function) => {
                port.afr(pin / 8).modify(|w| w.set_afr(pin % 8, function));
                port.ospeedr()
                    .modify(|w| w.set_ospeedr(pin, Ospeedr::VERY_HIGH_SPEED));
                (Moder::ALTERNATE, Pupdr::PULL_DOWN)
            }
            Use::Low => {
                port.bsrr().write(|w| w.set_br(pin, true));
                (Moder::OUTPUT, Pupdr::FLOATING)
            }
            Use::PulledUp => (Moder::INPUT, Pupdr::PULL_UP),
        };
        port.pupdr().modify(|w| w.set_pupdr(pin, pull));
        port.moder().modify(|w| w.set_moder(pin, mode));
    }
}
