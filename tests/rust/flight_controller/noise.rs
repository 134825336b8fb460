//! Random words on an armed wire, and genuine links with errors.

use siskin_params::ParamId;

use super::sender::{FlightController, frame};

const HALF: u16 = 1048;
const HALF_RPM: f64 = 3_150.0;

/// xorshift64*, so that words and errors are the same in each run.
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn once_in(&mut self, share: f64) -> bool {
        ((self.next() >> 11) as f64) < share * (1_u64 << 53) as f64
    }
}

/// One word in sixteen passes the check, and most of those are throttle.
#[test]
fn random_words_on_an_armed_wire_are_a_lost_signal() {
    for seed in 1..=8 {
        for (period_us, turns) in [(125, true), (1_000, true), (1_000, false), (10_000, true)] {
            let mut fc = FlightController::armed(&[(ParamId::MotStop, 1.0)]);
            if turns {
                fc.frames(1_000, HALF);
            }
            let mut chance = Chance(seed << 32 | period_us);
            let mut armed_us = 0;
            while fc.is_armed() {
                fc.word((chance.next() >> 48) as u16, period_us);
                armed_us += period_us;
                // A shaft at rest stays so throughout.
                assert!(turns || fc.rpm().abs() < 1.0, "{} rpm", fc.rpm());
                assert!(armed_us < 1_000_000, "seed {seed}, {period_us} µs");
            }
            assert!(fc.said("Throttle: signal lost while armed"));
            assert!(
                period_us != 1_000 || armed_us <= 200_000,
                "seed {seed}: {armed_us} µs"
            );
            for _ in 0..4_000_000 / period_us {
                fc.word((chance.next() >> 48) as u16, period_us);
                assert!(!fc.is_armed());
            }
            assert!(fc.rpm().abs() < 1.0, "{} rpm", fc.rpm());
        }
    }
}

/// A link with one bit in twenty wrong: more than half of its frames fail.
#[test]
fn a_true_link_with_errors_keeps_flying() {
    for (bit_errors, least_rpm, most_rpm) in [(0.01, 3_087.0, 3_213.0), (0.05, 2_800.0, 3_500.0)] {
        let mut fc = FlightController::armed(&[]);
        fc.frames(2_000, HALF);
        assert!((fc.rpm() - HALF_RPM).abs() < 32.0);
        let mut chance = Chance(7);
        for _ in 0..5_000 {
            let wrong = (0..16).fold(0, |word, bit| {
                word | u16::from(chance.once_in(bit_errors)) << bit
            });
            fc.word(frame(HALF) ^ wrong, 1_000);
            assert!(fc.is_armed());
            let rpm = fc.rpm();
            assert!((least_rpm..most_rpm).contains(&rpm), "{rpm} rpm");
        }
    }
}

/// Nothing gets through for 80 ms, as next to a strong transmitter, four times a second.
#[test]
fn a_true_link_survives_bursts() {
    for period_us in [125, 1_000, 5_000] {
        let mut fc = FlightController::armed(&[]);
        fc.frames(1_000, HALF);
        for _ in 0..8 {
            for _ in 0..80_000 / period_us {
                fc.word(frame(HALF) ^ 1, period_us);
                assert!(fc.is_armed());
            }
            for _ in 0..170_000 / period_us {
                fc.word(frame(HALF), period_us);
                assert!(fc.is_armed());
            }
        }
    }
}
