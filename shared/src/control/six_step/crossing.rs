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

use crate::math::{Held, divide};
use crate::trace::traced;
use crate::units::Voltage;

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
        let to_come = (self.slope > Voltage::ZERO).then(|| periods(reading, self.slope))?;
        Some(whole(self.samples - at).minus(to_come.min(whole(self.samples))))
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
mod tests {
    use super::*;
    use core::f64::consts::TAU;

    const BUS_V: f64 = 24.0;
    const BASE_V: f64 = 80.0;
    const COUNT_V: f64 = 70.0 / 4096.0;

    fn config() -> Config {
        Config {
            least: Voltage::from_num(0.05 / BASE_V),
            greatest: Voltage::from_num(68.0 / BASE_V),
            delayed: 1,
        }
    }

    /// The terminal voltage for a back-EMF, clamped by the diodes and quantised to counts.
    fn terminal(emf_v: f64) -> Voltage {
        let held_v = (1.5 * emf_v).clamp(0.0, BUS_V + 0.7);
        Voltage::from_num((held_v / COUNT_V).round() * COUNT_V / BASE_V)
    }

    /// Runs one sextant of a motor with this back-EMF, V, and this many periods per sextant, the first sample
    /// `offset` periods after its start; the previous phase's current decays for `dies` samples. Returns the error
    /// of the crossing's instant, periods.
    fn sextant(
        state: &mut State,
        rising: bool,
        (emf_v, sextant_periods, offset): (f64, f64, f64),
        dies: u32,
    ) -> Option<f64> {
        let config = config();
        state.begin(&config);
        let mut error = None;
        let mut sample = 0;
        loop {
            let t = f64::from(sample) + offset - f64::from(config.delayed);
            if t > sextant_periods {
                return error;
            }
            let from_crossing = t - sextant_periods / 2.0;
            let wave = (from_crossing / sextant_periods * TAU / 6.0).sin();
            let emf_v = if rising { emf_v * wave } else { -emf_v * wave };
            let reading = if t < 0.0 {
                terminal(10.0)
            } else if t < f64::from(dies) {
                terminal(if rising { 100.0 } else { -100.0 })
            } else {
                terminal(emf_v)
            };
            let bus = Voltage::from_num(BUS_V / BASE_V);
            if let Some(age) = look(&config, state, rising, false, 1, reading, (Leg::Low, bus)) {
                assert!(error.is_none(), "once a sextant");
                error = Some(t - age.to_num::<f64>() - sextant_periods / 2.0);
            }
            sample += 1;
        }
    }

    /// Returns (V, periods per sextant) of the bench with 12 pole pairs and 1.3 mWb at 40 kHz.
    fn bench(rpm: f64) -> (f64, f64) {
        (
            rpm / 60.0 * 12.0 * TAU * 1.3e-3,
            40_000.0 * 60.0 / (rpm * 72.0),
        )
    }

    #[test]
    fn the_instant_is_found_to_a_degree_from_1000_to_6000_rpm() {
        for rpm in [1000.0, 2000.0, 3000.0, 4500.0, 6000.0] {
            let (emf_v, periods) = bench(rpm);
            let mut state = State::default();
            for i in 0..200 {
                let offset = f64::from(i) * 0.618 % 1.0;
                let dies = u32::from(rpm > 4000.0);
                let error = sextant(&mut state, i % 2 == 0, (emf_v, periods, offset), dies);
                let error_deg = error.expect("it is seen") / periods * 60.0;
                if i >= 4 {
                    // Half a count is 0.2° at 1000 rpm; the sine's curvature makes up the rest.
                    assert!(error_deg.abs() < 1.0, "{rpm} {i}: {error_deg}");
                }
            }
        }
    }

    #[test]
    fn a_current_that_hides_the_crossing_is_no_crossing_of_a_falling_phase() {
        let (emf_v, periods) = bench(6000.0);
        let mut state = State::default();
        assert_eq!(sextant(&mut state, false, (emf_v, periods, 0.5), 4), None);
        assert!(state.blind());
    }

    #[test]
    fn a_rising_phase_that_is_seen_late_is_extrapolated_to_its_crossing() {
        let (emf_v, periods) = bench(6000.0);
        let mut state = State::default();
        for _ in 0..2 {
            sextant(&mut state, true, (emf_v, periods, 0.5), 1);
        }
        // The crossing is at 2.78 periods, the first free sample at 4.5.
        let error = sextant(&mut state, true, (emf_v, periods, 0.5), 4);
        let error_deg = error.expect("seen late") / periods * 60.0;
        assert!(error_deg.abs() < 2.0, "{error_deg}");
    }

    #[test]
    fn strictly_a_rising_phase_must_have_been_below() {
        let config = config();
        let bus = Voltage::from_num(BUS_V / BASE_V);
        let mut state = State::default();
        for _ in 0..10 {
            assert_eq!(
                look(
                    &config,
                    &mut state,
                    true,
                    true,
                    1,
                    terminal(1.0),
                    (Leg::Low, bus)
                ),
                None
            );
        }
        look(
            &config,
            &mut state,
            true,
            true,
            1,
            terminal(-0.1),
            (Leg::Low, bus),
        );
        assert!(
            look(
                &config,
                &mut state,
                true,
                true,
                1,
                terminal(0.1),
                (Leg::Low, bus)
            )
            .is_some()
        );
    }

    #[test]
    fn a_motor_at_rest_never_crosses() {
        let config = config();
        let bus = Voltage::from_num(BUS_V / BASE_V);
        for rising in [true, false] {
            let mut state = State::default();
            for i in 0..100_000_u32 {
                // Noise of up to three counts.
                let reading = terminal(COUNT_V / 1.5 * f64::from(i * 7 % 11 % 4));
                assert_eq!(
                    look(
                        &config,
                        &mut state,
                        rising,
                        true,
                        4,
                        reading,
                        (Leg::Low, bus)
                    ),
                    None
                );
            }
        }
    }

    /// The terminal's reading while the switching leg is at the supply.
    fn beside_the_supply(emf_v: f64) -> Voltage {
        terminal((BUS_V / 2.0 + 1.5 * emf_v) / 1.5)
    }

    #[test]
    fn at_full_duty_a_crossing_that_was_hidden_is_found_by_the_slope() {
        let bus = Voltage::from_num(BUS_V / BASE_V);
        for sign in [1.0, -1.0] {
            let mut state = State {
                slope: Voltage::from_num(1.5 * 2.0 / BASE_V),
                ..State::default()
            };
            let mut see = |reading| {
                look(
                    &config(),
                    &mut state,
                    sign > 0.0,
                    false,
                    1,
                    reading,
                    (Leg::High, bus),
                )
            };
            // The previous sextant's, then a diode's at either rail; the crossing is a period and a half past.
            for rail_v in [10.0, -100.0, 100.0] {
                assert_eq!(see(terminal(rail_v)), None);
            }
            let age = see(beside_the_supply(sign * 3.0)).expect("past the crossing");
            assert!((age.to_num::<f64>() - 1.5).abs() < 0.02, "{age}");
            assert_eq!(see(beside_the_supply(sign * 5.0)), None, "once");
        }
    }

    #[test]
    fn a_crossing_to_come_is_expected_by_the_slope() {
        let bus = Voltage::from_num(BUS_V / BASE_V);
        let mut state = State {
            slope: Voltage::from_num(1.5 * 2.0 / BASE_V),
            ..State::default()
        };
        assert_eq!(state.expected(), None);
        for reading in [terminal(10.0), beside_the_supply(-4.0)] {
            look(
                &config(),
                &mut state,
                true,
                false,
                1,
                reading,
                (Leg::High, bus),
            );
        }
        let age = state.expected().expect("seen").to_num::<f64>();
        assert!((age + 2.0).abs() < 0.02, "{age}");
    }

    #[test]
    fn a_sample_between_two_kinds_of_periods_tells_nothing() {
        let (bus, mut state) = (Voltage::from_num(BUS_V / BASE_V), State::default());
        for _ in 0..8 {
            let found = look(
                &config(),
                &mut state,
                true,
                false,
                1,
                terminal(3.0),
                (Leg::Changes, bus),
            );
            assert_eq!(found, None);
        }
        assert!(state.blind());
    }

    #[test]
    fn a_crossing_is_after_the_last_reading_before_it_whatever_the_slope_was() {
        // A slope from a tenth of the speed.
        let bus = Voltage::from_num(BUS_V / BASE_V);
        let mut state = State {
            slope: Voltage::from_num(0.02 / BASE_V),
            ..State::default()
        };
        let mut see = |emf_v| {
            look(
                &config(),
                &mut state,
                true,
                false,
                1,
                terminal(emf_v),
                (Leg::Low, bus),
            )
        };
        for emf_v in [10.0, -3.0, -1.0] {
            assert_eq!(see(emf_v), None);
        }
        assert_eq!(see(1.0), Some(I16F16::ONE));
    }
}
