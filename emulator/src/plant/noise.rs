//! Seeded noise.

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// A source of nearly Gaussian numbers: the same for the same seed on every machine.
#[derive(Clone, Debug)]
pub struct Noise(Xoshiro256PlusPlus);

impl Noise {
    /// The source of a seed.
    pub fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    /// A number of mean 0 and standard deviation 1, bounded by ±3.5: the sum of four uniform ones.
    pub fn gaussian(&mut self) -> f64 {
        let bits = self.0.next_u64();
        let sum = (0..4)
            .map(|i| i32::from((bits >> (16 * i)) as u16))
            .sum::<i32>();
        // Four uniform numbers of 65536 steps: mean 4·32767.5, variance 4·65536²/12.
        (f64::from(sum) - 131_070.0) * (3.0_f64.sqrt() / 65_536.0)
    }
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
