//! From the converters' counts to a [`Sample`].

use siskin_control::drive::Sample;
use siskin_control::units::AdcCounts;

use crate::board::Converters;

/// Fraction bits of [`AdcCounts`].
const FRACTION_BITS: u32 = AdcCounts::FRAC_NBITS;

/// Nominal reading without current, the middle of 12 bits: the drive measures what it really is.
const MIDDLE: i32 = 2048;

/// The readings of currents, supply, terminals and Hall sensors.
pub(crate) struct Sensors {
    converters: Converters,
}

impl Sensors {
    /// Readings of these converters.
    pub(crate) fn new(converters: Converters) -> Self {
        Self { converters }
    }

    /// The sample of this period.
    pub(crate) fn sample(&mut self) -> Sample {
        let Converters {
            first,
            second,
            hall,
        } = &mut self.converters;
        let [a, c, terminal_c, bus] = first.read_injected_samples();
        let [b, terminal_a, terminal_b] = second.read_injected_samples();
        let counts = |count: i32| AdcCounts::from_bits(count << FRACTION_BITS);
        // A current into the motor comes up through the low side's shunt and makes its voltage
        // negative.
        let current = |count: u16| counts(MIDDLE - i32::from(count));
        let voltage = |count: u16| counts(i32::from(count));
        let [hall_a, hall_b, hall_c] = hall.each_ref().map(|pin| u8::from(pin.is_high()));
        Sample {
            currents: [a, b, c].map(current),
            bus: voltage(bus),
            terminals: [terminal_a, terminal_b, terminal_c].map(voltage),
            hall: hall_a | hall_b << 1 | hall_c << 2,
        }
    }

    /// Whether the converters have finished since [`sample`](Self::sample).
    pub(crate) fn converted(&self) -> bool {
        embassy_stm32::pac::ADC1.isr().read().jeos()
    }
}
