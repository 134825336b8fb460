//! Current sensing: from the ADC readings to three phase currents, with offsets measured before every start,
//! and the phase that the shunts do not show reconstructed.
//!
//! A low-side shunt carries its phase's current only while the low side is on. The ADC samples at the counter's
//! top, in the middle of the low-side on-time and between two periods: the half before the sample follows from
//! the elapsed period's duty, the half after it from the next one's. The amplifier must have settled by then,
//! and sampling itself is short, so the half before counts: the elapsed period's duties.

use fixed::types::I16F16;
use siskin_params::Shunts;
use siskin_units::math::Held;
use siskin_units::{AdcCounts, Duty, traced};

/// Coefficients of the reconstruction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Which phases have a shunt.
    pub shunts: Shunts,
    /// Largest duty that leaves the low side on long enough to read.
    pub window: Duty,
    /// log2 of the readings averaged for an offset; about 5 ms.
    pub zero_readings_log2: u32,
    /// Largest offset of a sound sensor.
    pub offset_max: AdcCounts,
}

traced! {
    /// The offsets, and progress towards the next ones.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// Readings without current, subtracted from all later ones.
        pub offsets: [AdcCounts; 3],
        /// Sum of the readings so far over the total count: the mean once all are in.
        pub partial: [AdcCounts; 3],
        /// Number of readings so far.
        pub readings: u32,
    }
}

/// Progress of the offset measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Zeroing {
    /// More readings are needed.
    Measuring,
    /// The offsets are new; the next reading starts another measurement.
    Done,
    /// An offset exceeds that of a sound sensor; the previous offsets stay.
    Defect,
}

impl State {
    /// Restarts the measurement; the offsets stay.
    pub fn restart(&mut self) {
        self.partial = [AdcCounts::ZERO; 3];
        self.readings = 0;
    }
}

/// Adds one reading to the offsets; in the period after the last one, judges them. The bridge must have been
/// off long enough for the current to decay. The rotor may turn as long as its back-EMF is below the supply.
pub fn zero(config: &Config, state: &mut State, raw: [AdcCounts; 3]) -> Zeroing {
    if state.readings < 1 << config.zero_readings_log2 {
        for (partial, reading) in state.partial.iter_mut().zip(raw) {
            // The shift drops less than 2^-16 counts per reading.
            *partial += reading >> config.zero_readings_log2;
        }
        state.readings += 1;
        Zeroing::Measuring
    } else {
        judge(config, state)
    }
}

/// Takes over the offsets if the sensors are sound.
#[cold]
fn judge(config: &Config, state: &mut State) -> Zeroing {
    let mut measured = state.partial;
    if config.shunts == Shunts::Two {
        // The third channel has no sensor.
        measured[2] = AdcCounts::ZERO;
    }
    state.partial = [AdcCounts::ZERO; 3];
    state.readings = 0;
    let beyond = |offset: &AdcCounts| offset.saturating_abs() > config.offset_max;
    if measured.iter().any(beyond) {
        return Zeroing::Defect;
    }
    state.offsets = measured;
    Zeroing::Done
}

/// Returns a sample's readings minus their offsets.
pub fn read(state: &State, raw: [AdcCounts; 3]) -> [AdcCounts; 3] {
    let [a, b, c] = raw;
    let [offset_a, offset_b, offset_c] = state.offsets;
    [a.minus(offset_a), b.minus(offset_b), c.minus(offset_c)]
}

/// Returns a sample's phase currents.
///
/// `applied` are the elapsed period's duties, 0 for a phase whose high side did not switch. With three shunts,
/// the phase with the highest duty is minus the sum of the others where its window is too short. Where a second
/// window is too short as well, which the modulator's limit prevents, the two longest windows still serve,
/// though their readings may not have settled.
pub fn currents(
    config: &Config,
    state: &State,
    raw: [AdcCounts; 3],
    applied: [Duty; 3],
) -> [AdcCounts; 3] {
    let [a, b, c] = read(state, raw);
    let other = |x: AdcCounts, y: AdcCounts| I16F16::ZERO.minus(x).minus(y);
    if config.shunts == Shunts::Two {
        return [a, b, other(a, b)];
    }
    let [duty_a, duty_b, duty_c] = applied;
    let highest = duty_a.max(duty_b).max(duty_c);
    if highest <= config.window {
        [a, b, c]
    } else if highest == duty_a {
        [other(b, c), b, c]
    } else if highest == duty_b {
        [a, other(c, a), c]
    } else {
        [a, b, other(a, b)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn config(shunts: Shunts) -> Config {
        Config {
            shunts,
            window: Duty::from_num(0.9),
            zero_readings_log2: 7,
            offset_max: AdcCounts::from_num(200),
        }
    }

    fn counts(values: [f64; 3]) -> [AdcCounts; 3] {
        values.map(AdcCounts::from_num)
    }

    fn duties(values: [f64; 3]) -> [Duty; 3] {
        values.map(Duty::from_num)
    }

    #[test]
    fn offsets_are_the_mean_of_the_readings() {
        let config = config(Shunts::Three);
        let mut state = State::default();
        for n in 0..=128 {
            let swing = if n % 2 == 0 { 5.0 } else { -5.0 };
            let raw = counts([30.0 + swing, -17.5 - swing, 3.25]);
            let found = zero(&config, &mut state, raw);
            assert_eq!(found == Zeroing::Done, n == 128);
        }
        let wanted = [30.0, -17.5, 3.25];
        for (offset, wanted) in state.offsets.iter().zip(wanted) {
            // 128 readings at 2^-16 each.
            assert!((offset.to_num::<f64>() - wanted).abs() < 0.002, "{offset}");
        }
        let seen = currents(
            &config,
            &state,
            counts([130.0, -17.5, -96.75]),
            duties([0.5; 3]),
        );
        for (seen, wanted) in seen.iter().zip([100.0, 0.0, -100.0]) {
            assert!((seen.to_num::<f64>() - wanted).abs() < 0.002, "{seen}");
        }
    }

    #[test]
    fn a_second_measurement_replaces_the_first() {
        let config = config(Shunts::Three);
        let mut state = State::default();
        for offset in [10.0, -20.0] {
            while zero(&config, &mut state, counts([offset; 3])) != Zeroing::Done {}
            assert_eq!(state.offsets, counts([offset; 3]));
        }
    }

    #[test]
    fn an_offset_beyond_the_bound_is_a_defect_and_is_not_used() {
        let config = config(Shunts::Three);
        let mut state = State::default();
        let mut last = Zeroing::Measuring;
        for _ in 0..=128 {
            assert_eq!(last, Zeroing::Measuring);
            last = zero(&config, &mut state, counts([0.0, -201.0, 0.0]));
        }
        assert_eq!(last, Zeroing::Defect);
        assert_eq!(state, State::default());
    }

    #[test]
    fn with_three_shunts_the_phase_whose_window_is_too_short_is_the_other_two() {
        let config = config(Shunts::Three);
        let state = State::default();
        let truth = counts([70.0, -20.0, -50.0]);
        for phase in 0..3 {
            let mut raw = truth;
            raw[phase] = AdcCounts::from_num(1000);
            let mut applied = [0.5; 3];
            applied[phase] = 0.91;
            assert_eq!(currents(&config, &state, raw, duties(applied)), truth);
            applied[phase] = 0.9;
            assert_eq!(currents(&config, &state, raw, duties(applied)), raw);
        }
    }

    #[test]
    fn with_two_short_windows_the_longest_two_count() {
        let config = config(Shunts::Three);
        let raw = counts([300.0, 10.0, -30.0]);
        let seen = currents(&config, &State::default(), raw, duties([0.97, 0.92, 0.1]));
        assert_eq!(seen, counts([20.0, 10.0, -30.0]));
    }

    #[test]
    fn with_two_shunts_the_third_phase_is_never_read() {
        let config = config(Shunts::Two);
        let raw = counts([70.0, -20.0, 1234.0]);
        for applied in [[0.1; 3], [0.9, 0.1, 0.95]] {
            let seen = currents(&config, &State::default(), raw, duties(applied));
            assert_eq!(seen, counts([70.0, -20.0, -50.0]));
        }
    }

    proptest! {
        #[test]
        fn no_reading_overflows(
            raw: [i32; 3], offsets: [i32; 3], applied: [u32; 3], two: bool,
        ) {
            let config = config(if two { Shunts::Two } else { Shunts::Three });
            let raw = raw.map(AdcCounts::from_bits);
            let mut state = State {
                offsets: offsets.map(AdcCounts::from_bits),
                ..State::default()
            };
            // Whatever is read, one current at most is made up, of the other two.
            let seen = currents(&config, &state, raw, applied.map(Duty::from_bits));
            let own = read(&state, raw);
            let made_up = (0..3).filter(|&phase| seen[phase] != own[phase]).count();
            prop_assert!(made_up <= 1, "{:?} of {:?}", seen, own);
            for _ in 0..256 {
                if zero(&config, &mut state, raw) == Zeroing::Done {
                    let sound = |offset: &AdcCounts| offset.saturating_abs() <= config.offset_max;
                    prop_assert!(state.offsets.iter().all(sound), "{:?}", state.offsets);
                }
            }
        }
    }
}
