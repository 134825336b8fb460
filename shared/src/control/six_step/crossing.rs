//! Zero-crossing detection on the floating phase.
//!
//! The terminals are sampled in the middle of the low-side on-time. Both conducting legs are at 0 V then, and their
//! switches' drops cancel at the star point, so the floating terminal is at 1.5 times its back-EMF: the crossing is
//! against ground at any duty and supply. The modulator's minimum low-side on-time keeps PWM edges away from the
//! sample. Below a diode's drop the terminal is clamped, so only the positive side has a value, and the crossing's
//! instant is extrapolated from it.
//!
//! At full duty the switching leg is never low. The star point is then at half of the supply, and the terminal shows its
//! back-EMF on both sides of the crossing.
//!
//! After a commutation the released phase's current freewheels through a diode until it has decayed. From a leg
//! that was low it takes the terminal to the supply, above any back-EMF, so such a reading is ignored. From a leg
//! that switched it takes the terminal to ground, which looks like a crossing, so a falling phase must have been
//! seen above first.

use fixed::types::I16F16;
use siskin_units::math::{Held, divide};
use siskin_units::{Voltage, traced};

/// Thresholds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Reading above which the back-EMF is positive, beyond ADC noise.
    pub least: Voltage,
    /// Largest valid reading; above it the ADC saturates.
    pub greatest: Voltage,
    /// Samples after a commutation that still belong to the previous sextant.
    pub delayed: u16,
}

traced! {
    /// The present sextant's readings.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// Samples in this sextant.
        pub samples: u16,
        /// The last reading was above the threshold.
        pub side: bool,
        /// Consecutive readings on that side.
        pub run: u16,
        /// The last sample at which a rising phase was certainly below the threshold; 0 if it never was.
        pub below: u16,
        /// The first and last readings that tell how far the crossing is.
        pub seen: Option<Span>,
        /// The crossing has been found.
        pub found: bool,
        /// Change of the reading per period near the crossing, from earlier sextants; 0 while unknown.
        pub slope: Voltage,
    }
}

traced! {
    /// Two readings of one sextant.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Span {
        /// Sample number and value of the first; values count from the crossing, negative before it.
        pub first: (u16, Voltage),
        /// Sample number and value of the last.
        pub last: (u16, Voltage),
    }
}

/// Where the switching leg was at the sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leg {
    /// At ground, as in every period in which it switches.
    Low,
    /// At the supply for the whole period.
    High,
    /// On its way: what the terminal shows depends on the sample's exact time.
    Changes,
}

/// log2 of the supply over the distance from a rail within which a terminal may be held by a diode.
const RAIL_SHIFT: u32 = 4;

impl State {
    /// Returns true if no reading of this sextant was usable: the released phase's current has not decayed.
    pub fn blind(&self) -> bool {
        self.below == 0 && self.seen.is_none()
    }

    /// Returns how many periods ago the crossing was, negative if it is still to come, by a reading before it.
    pub fn expected(&self) -> Option<I16F16> {
        let (at, reading) = self.seen?.last;
        let is_before = self.slope > Voltage::ZERO && reading < Voltage::ZERO;
        let to_come = is_before.then(|| periods(reading, self.slope))?;
        Some(whole(self.samples - at).minus(to_come.min(whole(self.samples))))
    }

    /// Returns true if the last reading was beyond what a terminal without back-EMF shows.
    pub fn shows_rotor(&self, config: &Config) -> bool {
        self.seen
            .is_some_and(|span| span.last.1.saturating_abs() >= config.least)
    }

    /// Begins the next sextant.
    pub fn begin(&mut self, config: &Config) {
        let slope = self.measured_slope(config).unwrap_or(self.slope);
        *self = Self {
            slope,
            ..Self::default()
        };
    }

    fn see(&mut self, reading: Voltage) {
        let now = (self.samples, reading);
        let first = self.seen.map_or(now, |span| span.first);
        self.seen = Some(Span { first, last: now });
    }

    /// Returns the measured slope if the reading has changed well beyond ADC steps and noise.
    fn measured_slope(&self, config: &Config) -> Option<Voltage> {
        let Span { first, last } = self.seen?;
        let samples = i32::from(last.0 - first.0);
        let change = last.1.minus(first.1).saturating_abs();
        if change < config.least.saturating_mul_int(2) {
            return None;
        }
        change.checked_div_int(samples)
    }
}

/// Processes a sample of the floating terminal, for a phase that is `rising` or falling.
///
/// Returns, once per sextant, how many periods ago the crossing was. A side counts after `certain` consecutive
/// readings. With `strict` a rising phase too must first have been seen on the other side: until the start has
/// found the rotor, one swinging backwards looks like one past its crossing.
// Inlined although long: the call would be longer than what it saves.
#[inline]
pub fn look(
    config: &Config,
    state: &mut State,
    rising: bool,
    strict: bool,
    certain: u16,
    terminal: Voltage,
    (leg, bus): (Leg, Voltage),
) -> Option<I16F16> {
    state.samples = state.samples.saturating_add(1);
    if state.samples <= config.delayed {
        return None;
    }
    match leg {
        Leg::Low => {}
        Leg::High => return look_while_high(config, state, rising, terminal, bus),
        Leg::Changes => return None,
    }
    // Line to line, a driven motor's back-EMF is below the supply: 1.5 times a phase's at 30° from its crossing is
    // 0.43 of that, at 60° 0.75.
    let clamped = (bus >> 2).saturating_mul_int(3).min(config.greatest);
    if terminal >= clamped {
        return None;
    }
    let above = terminal > config.least;
    state.run = if above == state.side {
        state.run.saturating_add(1)
    } else {
        1
    };
    state.side = above;
    if state.run < certain {
        return None;
    }
    if rising {
        if above {
            rising_above(state, strict, certain, terminal)
        } else {
            if !state.found {
                state.below = state.samples;
            }
            None
        }
    } else if state.found {
        None
    } else if above {
        state.see(terminal.saturating_neg());
        None
    } else {
        falling_below(state)
    }
}

/// Processes a sample that was taken while the switching leg was at the supply. The star point is at half of it, and a
/// terminal shows its back-EMF on both sides of that: where the released phase's current has hidden the crossing, the
/// first reading after it still tells when it was.
fn look_while_high(
    config: &Config,
    state: &mut State,
    rising: bool,
    terminal: Voltage,
    bus: Voltage,
) -> Option<I16F16> {
    // A terminal at a rail carries current, whatever its back-EMF.
    let margin = bus >> RAIL_SHIFT;
    if terminal <= margin || terminal >= bus.minus(margin).min(config.greatest) {
        return None;
    }
    let reading = terminal.minus(bus >> 1);
    let past = if rising {
        reading
    } else {
        reading.saturating_neg()
    };
    let before = state.seen.map_or(0, |span| span.last.0);
    state.see(past);
    if state.found || past < config.least {
        return None;
    }
    state.found = true;
    Some(periods(past, state.slope).min(whole(state.samples - before)))
}

fn rising_above(
    state: &mut State,
    strict: bool,
    certain: u16,
    terminal: Voltage,
) -> Option<I16F16> {
    if strict && state.below == 0 {
        return None;
    }
    state.see(terminal);
    if state.found {
        return None;
    }
    state.found = true;
    // The reading has grown from zero since the crossing, which was within this sextant, and after a reading below.
    let grows = periods(terminal, state.slope).max(whole(certain - 1));
    Some(grows.min(whole(state.samples - state.below)))
}

fn falling_below(state: &mut State) -> Option<I16F16> {
    let (at, reading) = state.seen?.last;
    state.found = true;
    // The crossing came this much later than the last reading; a slow rotor still falls a while below the
    // threshold.
    let falls = periods(reading, state.slope).min(whole(state.samples / 2));
    Some(whole(state.samples - at).minus(falls).max(I16F16::ZERO))
}

fn whole(samples: u16) -> I16F16 {
    I16F16::from_num(samples.min(1 << 14))
}

/// Returns the time in which a reading grows by this slope; zero if the slope is unknown.
fn periods(reading: Voltage, slope: Voltage) -> I16F16 {
    let reading = reading.saturating_abs();
    if slope <= Voltage::ZERO {
        return I16F16::ZERO;
    }
    let quotient = divide((reading.to_bits() as u64) << 16, slope.to_bits() as u32);
    I16F16::from_bits(quotient.min(1 << 30) as i32)
}

#[cfg(test)]
mod tests;
