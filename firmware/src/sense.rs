//! From the converters' counts to a [`Sample`].

use siskin_control::drive::Sample;
use siskin_control::units::AdcCounts;

use crate::board::Converters;

/// Over how many periods the offsets are averaged, as a power of two: 1024 take 43 ms at 24 kHz
/// and leave a 32nd of one reading's noise.
const OFFSET_PERIODS_LOG2: u32 = 10;

/// Fraction bits of [`AdcCounts`].
const FRACTION_BITS: u32 = AdcCounts::FRAC_NBITS;

/// The readings of currents and supply.
pub(crate) struct Sensors {
    converters: Converters,
    /// Sum of the readings without current, then 2^10 times the offset.
    offset_sums: [u32; 3],
    /// Periods for which the offsets are still measured.
    offset_periods_left: u32,
}

impl Sensors {
    /// Readings whose offsets are measured first.
    pub(crate) fn new(converters: Converters) -> Self {
        Self {
            converters,
            offset_sums: [0; 3],
            offset_periods_left: 1 << OFFSET_PERIODS_LOG2,
        }
    }

    /// The sample of this period, or `None` while the offsets are measured: until then the bridge
    /// must be off.
    pub(crate) fn sample(&mut self) -> Option<Sample> {
        let [a, bus] = self.converters.a_bus.read_injected_samples();
        let [b, c] = self.converters.b_c.read_injected_samples();
        let counts = [a, b, c];
        if self.offset_periods_left > 0 {
            self.offset_periods_left -= 1;
            for (sum, count) in self.offset_sums.iter_mut().zip(counts) {
                // 1024 readings of 12 bits: 22 bits.
                *sum += u32::from(count);
            }
            return None;
        }
        let current = |phase: usize| {
            let offset = self.offset_sums[phase] << (FRACTION_BITS - OFFSET_PERIODS_LOG2);
            // A current into the motor comes up through the low side's shunt and makes its voltage
            // negative. Both terms are below 2^28.
            AdcCounts::from_bits(offset as i32 - (i32::from(counts[phase]) << FRACTION_BITS))
        };
        Some(Sample {
            currents: [current(0), current(1), current(2)],
            bus: AdcCounts::from_bits(i32::from(bus) << FRACTION_BITS),
        })
    }

    /// Whether the converters have finished since [`sample`](Self::sample).
    pub(crate) fn converted(&self) -> bool {
        embassy_stm32::pac::ADC1.isr().read().jeos()
    }
}
