//! Pins that are set up once and stay as they are.

use embassy_stm32::pac;
use embassy_stm32::pac::gpio::Gpio;
use embassy_stm32::pac::gpio::vals::{Moder, Ospeedr, Pupdr};

/// The use of a pin. One that is not set up is analogue, as the reset has left it.
#[derive(Clone, Copy)]
pub(crate) enum Use {
    /// A gate signal, by this alternate function: as fast as a pin is, and pulled down, so that the gate
    /// is off while nothing drives it.
    Gate(u8),
    /// An output that is low for ever.
    Low,
    /// An input that is pulled up.
    PulledUp,
}

/// A port of the chip. The PAC's own ports are addresses, which a constant cannot compare.
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

/// A port, the number of a pin there, and what the pin is for.
pub(crate) type Pin = (Port, u8, Use);

/// Whether each pin and its alternate function exist and no pin is named twice.
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

/// Sets pins up. What they do comes last, so that none does anything else before.
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
