//! A port of pins (RM0440, 9.4). Levels change at once, whatever OSPEEDR says.

use stm32_metapac::gpio::regs::{Afr, Bsrr, Moder, Odr, Ospeedr, Otyper, Pupdr};
use stm32_metapac::gpio::vals::{self, Ot};

use super::{Context, Part, Signal, Unmodelled};

/// Pins of a port.
const PINS: usize = 16;

/// The port.
#[derive(Debug)]
pub struct Port {
    port: u8,
    modes: Moder,
    types: Otyper,
    speeds: Ospeedr,
    pulls: Pupdr,
    output: Odr,
    functions: [Afr; 2],
    driven: [Option<bool>; PINS],
    inputs: [Option<bool>; PINS],
}

impl Port {
    /// Creates a port, 0 for A, as after a reset, with undriven pins. The debugger's pins have their
    /// alternate function, all others are analog.
    pub fn new(port: u8) -> Self {
        let (modes, speeds, pulls) = match port {
            0 => (0xabff_ffff, 0x0c00_0000, 0x6400_0000),
            1 => (0xffff_febf, 0x0000_00c0, 0x0000_0100),
            _ => (0xffff_ffff, 0, 0),
        };
        Self {
            port,
            modes: Moder(modes),
            types: Otyper(0),
            speeds: Ospeedr(speeds),
            pulls: Pupdr(pulls),
            output: Odr(0),
            functions: [Afr(0); 2],
            driven: [None; PINS],
            inputs: [None; PINS],
        }
    }

    /// Resets its registers; what comes from outside stays.
    pub fn reset(&mut self, context: &mut Context) {
        *self = Self {
            driven: self.driven,
            inputs: self.inputs,
            ..Self::new(self.port)
        };
        self.tell(context);
    }

    /// Drives a pin from outside, or from a part of the chip by its alternate function, or releases it.
    pub fn set_input(&mut self, pin: u8, level: Option<bool>) {
        self.inputs[usize::from(pin)] = level;
    }

    /// Returns what a pin is used for.
    pub fn mode(&self, pin: u8) -> vals::Moder {
        self.modes.moder(pin.into())
    }

    /// Returns a pin's alternate function, if it has one.
    pub fn alternate(&self, pin: u8) -> Option<u8> {
        let pin = usize::from(pin);
        let is_alternate = self.modes.moder(pin) == vals::Moder::ALTERNATE;
        is_alternate.then(|| self.functions[pin / 8].afr(pin % 8))
    }

    /// Returns a pin's level: as driven, or as pulled; a floating pin is low. The port's own drive
    /// overrides one from outside.
    pub fn level(&self, pin: u8) -> bool {
        let pin = usize::from(pin);
        let is_digital = self.modes.moder(pin) != vals::Moder::ANALOG;
        let pull = is_digital && self.pulls.pupdr(pin) == vals::Pupdr::PULL_UP;
        self.driven[pin].or(self.inputs[pin]).unwrap_or(pull)
    }

    /// Returns the level to which the port itself drives a pin as a general-purpose output.
    fn drive(&self, pin: usize) -> Option<bool> {
        let high = self.output.odr(pin) == vals::Odr::HIGH;
        let lets_go = high && self.types.ot(pin) == Ot::OPEN_DRAIN;
        let drives = self.modes.moder(pin) == vals::Moder::OUTPUT && !lets_go;
        drives.then_some(high)
    }

    fn tell(&mut self, context: &mut Context) {
        for pin in 0..PINS {
            let level = self.drive(pin);
            if level != self.driven[pin] {
                self.driven[pin] = level;
                context.signals.push(Signal::Pin {
                    port: self.port,
                    pin: pin as u8,
                    level,
                });
            }
        }
    }

    /// Returns the levels as read: an analog pin reads low.
    pub(crate) fn input(&self) -> u32 {
        (0..PINS as u8)
            .filter(|pin| self.mode(*pin) != vals::Moder::ANALOG && self.level(*pin))
            .fold(0, |levels, pin| levels | 1 << pin)
    }

    /// Sets and resets outputs; set wins.
    fn change(&mut self, bits: Bsrr) {
        let [set, reset] = [bits.0 & 0xffff, bits.0 >> 16];
        self.output = Odr(self.output.0 & !reset | set);
    }
}

impl Part for Port {
    fn read(&mut self, offset: u32, _: &mut Context) -> Result<u32, Unmodelled> {
        match offset {
            0x00 => Ok(self.modes.0),
            0x04 => Ok(self.types.0),
            0x08 => Ok(self.speeds.0),
            0x0c => Ok(self.pulls.0),
            0x10 => Ok(self.input()),
            0x14 => Ok(self.output.0),
            // Write-only.
            0x18 | 0x28 => Ok(0),
            0x20 => Ok(self.functions[0].0),
            0x24 => Ok(self.functions[1].0),
            _ => Err(Unmodelled),
        }
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        match offset {
            0x00 => self.modes = Moder(value),
            0x04 => self.types = Otyper(value & 0xffff),
            0x08 => self.speeds = Ospeedr(value),
            0x0c => {
                let pulls = Pupdr(value);
                // Both pulls at once are reserved.
                if (0..PINS).any(|pin| pulls.pupdr(pin).to_bits() == 3) {
                    return Err(Unmodelled);
                }
                self.pulls = pulls;
            }
            0x14 => self.output = Odr(value & 0xffff),
            0x18 => self.change(Bsrr(value)),
            0x20 => self.functions[0] = Afr(value),
            0x24 => self.functions[1] = Afr(value),
            0x28 => self.change(Bsrr(value << 16)),
            _ => return Err(Unmodelled),
        }
        self.tell(context);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODES: u32 = 0x00;
    const TYPES: u32 = 0x04;
    const PULLS: u32 = 0x0c;
    const SET: u32 = 0x18;
    const RESET: u32 = 0x28;

    fn write(port: &mut Port, offset: u32, value: u32) -> Vec<(u8, Option<bool>)> {
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        port.write(offset, value, &mut context).unwrap();
        pins(&signals)
    }

    fn pins(signals: &[Signal]) -> Vec<(u8, Option<bool>)> {
        let pins = signals.iter().map(|signal| match signal {
            Signal::Pin {
                port: 2,
                pin,
                level,
            } => (*pin, *level),
            other => panic!("{other:?}"),
        });
        pins.collect()
    }

    fn input(port: &mut Port) -> u32 {
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        port.read(0x10, &mut context).unwrap()
    }

    /// Returns port C with all pins as inputs.
    fn inputs() -> Port {
        let mut port = Port::new(2);
        assert_eq!(write(&mut port, MODES, 0), []);
        port
    }

    #[test]
    fn an_output_is_told_when_it_changes_and_when_it_is_let_go() {
        let mut port = inputs();
        assert_eq!(write(&mut port, SET, 1 << 6), []);
        assert_eq!(write(&mut port, MODES, 1 << 12), [(6, Some(true))]);
        assert_eq!(input(&mut port), 1 << 6);
        assert_eq!(write(&mut port, SET, 1 << 6), []);
        assert_eq!(write(&mut port, RESET, 1 << 6), [(6, Some(false))]);
        // Set and reset at once sets.
        assert_eq!(write(&mut port, SET, 1 << 22 | 1 << 6), [(6, Some(true))]);
        assert_eq!(write(&mut port, SET, 1 << 22), [(6, Some(false))]);
        assert_eq!(write(&mut port, MODES, 2 << 12), [(6, None)]);
    }

    #[test]
    fn an_open_drain_only_pulls_low() {
        let mut port = inputs();
        write(&mut port, TYPES, 1 << 3);
        write(&mut port, PULLS, 1 << 6);
        assert_eq!(write(&mut port, MODES, 1 << 6), [(3, Some(false))]);
        assert_eq!(input(&mut port), 0);
        assert_eq!(write(&mut port, SET, 1 << 3), [(3, None)]);
        assert_eq!(input(&mut port), 1 << 3);
        port.set_input(3, Some(false));
        assert_eq!(input(&mut port), 0);
    }

    #[test]
    fn a_pin_without_a_driver_follows_its_pull() {
        let mut port = inputs();
        // Up at 0, down at 1, none at 2.
        write(&mut port, PULLS, 0b00_10_01);
        assert_eq!(input(&mut port), 0b001);
        for pin in 0..3 {
            port.set_input(pin, Some(pin != 0));
        }
        assert_eq!(input(&mut port), 0b110);
        for pin in 0..3 {
            port.set_input(pin, None);
        }
        assert_eq!(input(&mut port), 0b001);
        // An analog pin has no pull and reads low.
        write(&mut port, MODES, 0b11);
        assert!(!port.level(0));
        port.set_input(0, Some(true));
        assert_eq!((input(&mut port), port.level(0)), (0, true));
    }

    #[test]
    fn a_reset_lets_go_but_leaves_the_outside() {
        let mut port = inputs();
        port.set_input(1, Some(true));
        write(&mut port, MODES, 1);
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        port.reset(&mut context);
        assert_eq!(pins(&signals), [(0, None)]);
        assert_eq!(port.mode(0), vals::Moder::ANALOG);
        assert!(port.level(1));
    }

    #[test]
    fn an_alternate_function_counts_in_its_mode() {
        let mut port = inputs();
        // TIM1_CH1N at PC13.
        write(&mut port, 0x24, 4 << 20);
        assert_eq!(port.alternate(13), None);
        write(&mut port, MODES, 2 << 26);
        assert_eq!((port.alternate(13), port.alternate(12)), (Some(4), None));
    }

    #[test]
    fn the_lock_and_double_pulls_are_refused() {
        let mut port = inputs();
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        assert_eq!(port.write(0x1c, 1, &mut context), Err(Unmodelled));
        assert_eq!(port.write(0x10, 1, &mut context), Err(Unmodelled));
        assert_eq!(port.write(PULLS, 3, &mut context), Err(Unmodelled));
    }
}
