//! Converts ADC counts to a [`Sample`].

use core::sync::atomic::Ordering;

use siskin_control::drive::Sample;
use siskin_units::AdcCounts;

use super::registers::{Registers, Stand};
use crate::board::WIRING;
use crate::board::wiring::Slot;
use crate::chip::READINGS_AT_WORD;

/// Fraction bits of [`AdcCounts`].
const FRACTION_BITS: u32 = AdcCounts::FRAC_NBITS;

/// Returns the sample of this period.
#[inline(always)] // in each period
pub(crate) fn sample(registers: &Registers) -> Sample {
    let counts = |count: i32| AdcCounts::from_bits(count << FRACTION_BITS);
    let reading =
        |Slot(converter, rank)| i32::from(registers.converters[converter].jdr(rank).read().jdata());
    let current = |slot: Option<Slot>| match slot {
        None => AdcCounts::ZERO,
        Some(slot) if WIRING.rises => counts(reading(slot) - WIRING.zero),
        Some(slot) => counts(WIRING.zero - reading(slot)),
    };
    let port_b = registers.port_b.idr().read().0;
    let port_c = if WIRING.hall.are_on_c() {
        registers.port_c.idr().read().0
    } else {
        0
    };
    // Unrolled: a loop would keep the bounds checks of the ranks.
    let [a, b, c] = WIRING.currents;
    let [at_a, at_b, at_c] = WIRING.terminals;
    Sample {
        currents: [current(a), current(b), current(c)],
        bus: counts(reading(WIRING.bus)),
        terminals: [
            counts(reading(at_a)),
            counts(reading(at_b)),
            counts(reading(at_c)),
        ],
        hall: WIRING.hall.code(port_b, port_c),
    }
}

/// Returns the place of each reading and its value: the inverse of [`sample`].
fn readings(sample: &Sample) -> impl Iterator<Item = (Slot, u32)> {
    let reading = |counts: AdcCounts| counts.to_num::<i32>();
    let current = move |counts: AdcCounts| {
        let counts = reading(counts);
        WIRING.zero + if WIRING.rises { counts } else { -counts }
    };
    let currents = (WIRING.currents.into_iter().zip(sample.currents))
        .filter_map(move |(slot, counts)| Some((slot?, current(counts))));
    let terminals = (WIRING.terminals.into_iter().zip(sample.terminals))
        .map(move |(slot, counts)| (slot, reading(counts)));
    currents
        .chain(terminals)
        .chain([(WIRING.bus, reading(sample.bus))])
        .map(|(slot, counts)| (slot, counts as u32))
}

impl Stand {
    /// Puts a sample where the board's converters and pins would show it.
    pub fn set_sample(&self, sample: &Sample) {
        for (Slot(converter, rank), counts) in readings(sample) {
            self.converters[converter][READINGS_AT_WORD + rank].store(counts, Ordering::Relaxed);
        }
        // GPIO's IDR is at 0x10; all other pins are high, which is no alarm.
        let levels = WIRING.hall.show(sample.hall, [!0; 2]);
        for (port, level) in [&self.port_b, &self.port_c].into_iter().zip(levels) {
            port[0x10 / 4].store(level, Ordering::Relaxed);
        }
    }
}
