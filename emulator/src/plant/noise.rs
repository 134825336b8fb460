//! Seeded noise.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// A source of nearly Gaussian numbers: the same for the same seed on every machine.
#[derive(Clone, Debug)]
pub struct Noise(Xoshiro256PlusPlus);

/// Every other of four 16-bit numbers.
const PAIRS: u64 = 0x0000_ffff_0000_ffff;

impl Noise {
    /// Creates the source of a seed.
    pub fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    /// Returns true with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        share_of(self.0.next_u64()) < probability
    }

    /// Returns a number of mean 0 and standard deviation 1, bounded by ±3.5: the sum of four
    /// uniform ones.
    pub fn gaussian(&mut self) -> f64 {
        // Two sums at once, then their sum.
        let bits = self.0.next_u64();
        let pairs = (bits & PAIRS) + (bits >> 16 & PAIRS);
        let sum = (pairs + (pairs >> 32)) as u32 as i32;
        // Four uniform numbers of 65536 steps: mean 4·32767.5, variance 4·65536²/12.
        (f64::from(sum) - 131_070.0) * (3.0_f64.sqrt() / 65_536.0)
    }
}

/// Returns a uniform number in 0..1 from random bits, as fine as a double holds.
pub fn share_of(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_and_deviation_are_those_of_the_standard_normal() {
        let mut noise = Noise::new(7);
        let n = 200_000;
        let samples: Vec<f64> = (0..n).map(|_| noise.gaussian()).collect();
        let mean = samples.iter().sum::<f64>() / f64::from(n);
        let variance = samples.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(n);
        assert!(mean.abs() < 0.01, "{mean}");
        assert!((variance - 1.0).abs() < 0.02, "{variance}");
    }

    #[test]
    fn a_seed_is_a_sequence() {
        let take = |seed| -> Vec<u64> {
            let mut noise = Noise::new(seed);
            (0..10).map(|_| noise.gaussian().to_bits()).collect()
        };
        assert_eq!(take(3), take(3));
        assert_ne!(take(3), take(4));
    }
}
