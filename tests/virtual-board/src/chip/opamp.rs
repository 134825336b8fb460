//! OPAMP1 to OPAMP3 as amplifiers with gains of 2 to 64, of a pin's voltage above the chip's ground or another
//! pin's.

use stm32_metapac::opamp::regs::Csr;
use stm32_metapac::opamp::vals::{PgaGain, VmSel, VpSel};

use super::{Context, Part, Unmodelled};

/// Supply, which the outputs can reach, V.
const SUPPLY_V: f64 = 3.3;

/// Pins (port, number; port 0 is A) at VP_SEL 0 to 2 (RM0440, op-amps' inputs).
const INPUTS: [[(u8, u8); 3]; 3] = [
    [(0, 1), (0, 3), (0, 7)],
    [(0, 7), (1, 14), (1, 0)],
    [(1, 0), (1, 13), (0, 1)],
];

/// Pins at VINM0.
const FEET: [(u8, u8); 3] = [(0, 3), (0, 5), (1, 2)];

/// Converters and channels at the internal output (RM0440, ADC connectivity).
const INSIDE: [(u8, u8); 3] = [(1, 13), (2, 16), (2, 18)];

/// Converters and channels at the output pin: PA2, PA6 and PB1.
const OUTSIDE: [(u8, u8); 3] = [(1, 3), (2, 3), (1, 12)];

/// The op-amps. Each has one register. The settling of their outputs is not modelled.
#[derive(Clone, Debug, Default)]
pub struct OpAmps {
    controls: [Csr; 3],
}

impl OpAmps {
    /// Creates them as after a reset.
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns the pin (port, number) at the input of an op-amp, from 0, while it is on.
    pub fn pin(&self, which: usize) -> Option<(u8, u8)> {
        let control = self.controls[which];
        let pin = INPUTS[which][usize::from(control.vp_sel().to_bits())];
        control.opampen().then_some(pin)
    }

    /// Returns the pin (port, number) at which the resistors of an op-amp, from 0, end, if not at the chip's
    /// ground.
    pub fn foot(&self, which: usize) -> Option<(u8, u8)> {
        matches!(gain(self.controls[which]), Some((_, Foot::Pin))).then_some(FEET[which])
    }

    /// Returns the output of an op-amp, from 0, for these voltages at its input and its foot, while it is on.
    pub fn output(&self, which: usize, volts: f64, foot_v: f64) -> Option<f64> {
        let control = self.controls[which];
        let (gain, _) = gain(control)?;
        let output = (foot_v + gain * (volts - foot_v)).clamp(0.0, SUPPLY_V);
        control.opampen().then_some(output)
    }

    /// Returns the op-amp, from 0, whose output is at a channel of a converter (1 or 2): internally, or at its
    /// pin.
    pub fn at(&self, converter: u8, channel: u8) -> Option<usize> {
        let led = |&which: &usize| {
            let control = self.controls[which];
            let way = if control.opaintoen() { INSIDE } else { OUTSIDE };
            control.opampen() && way[which] == (converter, channel)
        };
        (0..self.controls.len()).find(led)
    }
}

/// Where the gain resistors end.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Foot {
    /// The chip's ground.
    Ground,
    /// VINM0.
    Pin,
}

/// Returns the gain; `None` if it is not modelled.
fn gain(control: Csr) -> Option<(f64, Foot)> {
    match control.vm_sel() {
        VmSel::OUTPUT => Some((1.0, Foot::Ground)),
        VmSel::PGA => match control.pga_gain().to_bits() {
            // 2 to 64, with the resistors at the chip's ground; from 8 on at VINM0 (RM0440, PGA_GAIN).
            bits @ 0..=5 => Some((f64::from(2_u8 << bits), Foot::Ground)),
            bits @ 8..=13 => Some((f64::from(2_u8 << (bits - 8)), Foot::Pin)),
            _ => None,
        },
        VmSel::VINM0 | VmSel::VINM1 => None,
    }
}

impl Part for OpAmps {
    fn read(&mut self, offset: u32, _context: &mut Context) -> Result<u32, Unmodelled> {
        let control = self.controls.get(offset as usize / 4).ok_or(Unmodelled)?;
        Ok(control.0)
    }

    fn write(&mut self, offset: u32, value: u32, _context: &mut Context) -> Result<(), Unmodelled> {
        let control = self.controls.get_mut(offset as usize / 4);
        let control = control.ok_or(Unmodelled)?;
        let (mut known, new) = (Csr(0), Csr(value));
        known.set_opampen(true);
        known.set_vp_sel(VpSel::from_bits(3));
        known.set_vm_sel(VmSel::from_bits(3));
        known.set_opahsm(true);
        known.set_opaintoen(true);
        known.set_pga_gain(PgaGain::from_bits(31));
        let led = gain(new).is_some() && new.vp_sel() != VpSel::DAC3_CH1;
        if value & !known.0 != 0 || new.opampen() && !led {
            return Err(Unmodelled);
        }
        *control = new;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On, PGA, ×16, high speed.
    const BY_16: u32 = 1 | 2 << 5 | 1 << 7 | 3 << 14;

    /// Internally to the converter.
    const INTERNAL: u32 = 1 << 8;

    #[test]
    fn the_board_has_its_three() {
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        let mut amps = OpAmps::new();
        assert_eq!(amps.output(0, 0.1, 0.0), None);
        assert_eq!(amps.at(1, 13), None);
        for (offset, value) in [(0, BY_16 | INTERNAL), (4, BY_16 | INTERNAL), (8, BY_16)] {
            assert_eq!(amps.write(offset, value, &mut context), Ok(()));
            assert_eq!(amps.read(offset, &mut context), Ok(value));
        }
        let pins = [0, 1, 2].map(|which| amps.pin(which));
        assert_eq!(pins, [Some((0, 1)), Some((0, 7)), Some((1, 0))]);
        assert_eq!(amps.at(1, 13), Some(0));
        assert_eq!(amps.at(2, 16), Some(1));
        assert_eq!(amps.at(1, 12), Some(2));
        // The third one's internal output and the others' pins are not used.
        for (converter, channel) in [(2, 18), (1, 3), (2, 3)] {
            assert_eq!(amps.at(converter, channel), None);
        }
        for (volts, output) in [(0.1, 1.6), (-0.1, 0.0), (0.3, 3.3)] {
            let shown = amps.output(2, volts, 0.0).expect("it is on");
            assert!((shown - output).abs() < 1e-9);
        }
    }

    #[test]
    fn a_foot_at_a_pin_is_what_is_amplified_from() {
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        let mut amps = OpAmps::new();
        assert_eq!(amps.write(0, BY_16 | 8 << 14, &mut context), Ok(()));
        assert_eq!(amps.write(4, BY_16, &mut context), Ok(()));
        assert_eq!(amps.foot(0), Some((0, 3)));
        assert_eq!(amps.foot(1), None);
        // 16 times one less 15 times the other.
        let shown = amps.output(0, 0.11, 0.01).expect("it is on");
        assert!((shown - 1.61).abs() < 1e-9, "{shown}");
    }

    #[test]
    fn what_is_not_modelled_is_refused() {
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        let mut amps = OpAmps::new();
        // Standalone, a filter at the resistors, the DAC's input, trimming, a fourth one.
        let refused = [
            (0, 1),
            (0, 1 | 2 << 5 | 19 << 14),
            (0, BY_16 | 3 << 2),
            (0, BY_16 | 1 << 4),
            (12, BY_16),
        ];
        for (offset, value) in refused {
            assert_eq!(amps.write(offset, value, &mut context), Err(Unmodelled));
        }
    }
}
