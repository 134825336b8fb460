//! Pins that are set up once and stay as they are.

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

/// A port, the number of a pin there, and what the pin is for.
pub(crate) type Pin = (Gpio, u8, Use);

/// Sets pins up. What they do comes last, so that none does anything else before.
pub(crate) fn set_up(pins: &[Pin]) {
    for &(port, number, for_what) in pins {
        let pin = usize::from(number % 16);
        let (mode, pull) = match for_what {
            Use::Gate(function) => {
                port.afr(pin / 8).modify(|w| w.set_afr(pin % 8, function));
                port.ospeedr()
                    .modify(|w| w.set_ospeedr(pin, Ospeedr::VERY_HIGH_SPEED));
                (Moder::ALTERNATE, Pupdr::PULL_DOWN)
            }
            Use::Low => (Moder::OUTPUT, Pupdr::FLOATING),
            Use::PulledUp => (Moder::INPUT, Pupdr::PULL_UP),
        };
        port.pupdr().modify(|w| w.set_pupdr(pin, pull));
        port.moder().modify(|w| w.set_moder(pin, mode));
    }
}
