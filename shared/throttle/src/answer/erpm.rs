//! Speed in a reply, as the period of an electrical turn.
//!
//! `eeemmmmmmmmm` is m·2^e µs. Betaflight and ArduPilot shift by e; some descriptions say e − 1 and are wrong.
//! The mantissa is normalised: unless e is 0 its top bit is set, since words without it are extended telemetry.

use siskin_units::{Scale, Speed};

/// The word for a standing shaft, or a period of 65.3 ms and more: below 919 eRPM.
pub const STOPPED: u16 = 0xFFF;

/// The period from which the nearest word would be 511·2^7 µs, which is [`STOPPED`].
const LONGEST_US: f32 = 510.5 * 128.0;

/// One turn per control period, in bits of [`Speed`].
const TURN: f32 = 4_294_967_296.0;

/// Returns the word for a speed, whatever its direction.
pub fn of_speed(speed: Speed, scale: &Scale) -> u16 {
    let turns = speed.to_bits().unsigned_abs() as f32 / TURN;
    of_period_us(scale.period_s * 1e6 / turns)
}

/// Returns the word nearest to a period in µs; at least 1 µs, since no turn takes none.
fn of_period_us(period_us: f32) -> u16 {
    if period_us < LONGEST_US {
        let (mut mantissa, mut exponent) = (period_us, 0);
        // From here on rounding would give 512, which is 256 with the next exponent.
        while mantissa >= 511.5 {
            mantissa *= 0.5;
            exponent += 1;
        }
        exponent << 9 | ((mantissa + 0.5) as u16).max(1)
    } else {
        STOPPED
    }
}

/// Returns the period of a word, µs; `None` for a standing shaft, and for 0, which is never sent.
pub fn period_us(data: u16) -> Option<u32> {
    let period_us = u32::from(data & 0x1FF) << (data >> 9 & 7);
    (data & 0xFFF != STOPPED && period_us != 0).then_some(period_us)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::answer::extended::Extended;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// Returns every period that a word can express, with the word.
    fn words() -> Vec<(u32, u16)> {
        let words = (1..STOPPED).filter(|&word| Extended::from_data(word).is_none());
        words
            .filter_map(|word| Some((period_us(word)?, word)))
            .collect()
    }

    #[test]
    fn each_word_is_that_of_its_own_period() {
        let words = words();
        // 511 with exponent 0, 256 with each of the seven others, less the one for standstill.
        assert_eq!(words.len(), 511 + 7 * 256 - 1);
        for (period_us, word) in words {
            assert_eq!(of_period_us(period_us as f32), word);
        }
    }

    #[test]
    fn between_two_words_the_nearer_one_is_sent() {
        for pair in words().windows(2) {
            let [(less_us, less), (more_us, more)] = [pair[0], pair[1]];
            let middle_us = (less_us + more_us) as f32 / 2.0;
            assert_eq!(of_period_us(middle_us - 0.01), less, "{less_us} µs");
            assert_eq!(of_period_us(middle_us + 0.01), more, "{more_us} µs");
        }
    }

    #[test]
    fn what_stands_or_turns_too_slowly_is_stopped() {
        for period_us in [65_344.0, 65_408.0, 1e9, f32::INFINITY, f32::NAN] {
            assert_eq!(of_period_us(period_us), STOPPED);
        }
        assert_eq!(of_period_us(65_343.0), 0xFFE);
        assert_eq!(of_period_us(0.0), 1);
        assert_eq!(period_us(STOPPED), None);
        assert_eq!(period_us(0), None);
    }

    #[test]
    fn a_speed_is_told_without_its_direction() {
        // 6000 rpm with 12 pole pairs is 72000 eRPM: 833 µs per turn, nearest word 834.
        let scale = Scale {
            period_s: 1.0 / 24_000.0,
            current_a: 1.0,
            voltage_v: 1.0,
            pole_pairs: 12.0,
        };
        for rpm in [6000.0, -6000.0] {
            let word = of_speed(scale.speed_from_rpm(rpm), &scale);
            assert_eq!(period_us(word), Some(834));
        }
        assert_eq!(of_speed(Speed::ZERO, &scale), STOPPED);
    }

    proptest! {
        #[test]
        fn no_speed_looks_like_extended_telemetry(bits: i32, pwm_hz in 8000.0_f32..60_000.0) {
            let scale = Scale { period_s: 1.0 / pwm_hz, current_a: 1.0, voltage_v: 1.0, pole_pairs: 7.0 };
            let word = of_speed(Speed::from_bits(bits), &scale);
            prop_assert_eq!(Extended::from_data(word), None);
            let turns = f64::from(bits).abs() / f64::from(TURN);
            let true_us = 1e6 / f64::from(pwm_hz) / turns;
            match period_us(word) {
                // Half a step: 1/512 of the period, or half a microsecond.
                Some(told_us) => {
                    let error_us = (f64::from(told_us) - true_us).abs();
                    prop_assert!(error_us <= (true_us / 511.0).max(0.5) * 1.001, "{} for {}", told_us, true_us);
                }
                None => prop_assert!(true_us > 65_343.0),
            }
        }
    }
}
