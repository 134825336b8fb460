//! From the plant's quantities to the converter's counts.

use siskin_control::control::delay::Delay;
use siskin_control::drive::Sample;
use siskin_control::params::Board;
use siskin_control::units::AdcCounts;

use super::Noise;

/// Counts from zero to full scale of the control's converter, whatever the simulated resolution.
const FULL_SCALE_COUNTS: f64 = 2048.0;

/// Full scale of the supply's divider, V.
const BUS_RANGE_V: f64 = 70.0;

/// Counts of the supply's reading at full scale.
const BUS_COUNTS: f64 = 4096.0;

/// The current sensors and their converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensing {
    /// Full scale of the currents, ± amperes.
    pub range_a: f64,
    /// Resolution, bits with sign; 0 is exact.
    pub bits: u32,
    /// Noise, A rms.
    pub noise_a: f64,
    /// Error of each phase's zero, A.
    pub offset_a: [f64; 3],
}

impl Sensing {
    /// The board that these sensors make, for [`siskin_control::params::build`].
    pub fn board(&self, delay: Delay) -> Board {
        Board {
            current_a_per_count: (self.range_a / FULL_SCALE_COUNTS) as f32,
            bus_v_per_count: (BUS_RANGE_V / BUS_COUNTS) as f32,
            current_range_a: self.range_a as f32,
            delay,
            low_side_on_s: 1e-6,
        }
    }

    /// One sample of the phase currents, A, and of the supply, V.
    pub fn sample(&self, currents_a: [f64; 3], bus_v: f64, noise: &mut Noise) -> Sample {
        let mut counts = [AdcCounts::ZERO; 3];
        for phase in 0..3 {
            let mut current_a = currents_a[phase] + self.offset_a[phase];
            if self.noise_a > 0.0 {
                current_a += self.noise_a * noise.gaussian();
            }
            counts[phase] = self.quantised(current_a / self.range_a);
        }
        let bus = (bus_v / BUS_RANGE_V * BUS_COUNTS).clamp(0.0, BUS_COUNTS - 1.0);
        Sample {
            terminals: [AdcCounts::ZERO; 3],
            hall: 7,
            currents: counts,
            bus: fixed(if self.bits == 0 {
                bus
            } else {
                f64::from(nearest(bus))
            }),
        }
    }

    /// A share of full scale in counts, rounded to the resolution and held at its ends.
    fn quantised(&self, share: f64) -> AdcCounts {
        if self.bits == 0 {
            let highest = 1.0 - 1.0 / FULL_SCALE_COUNTS;
            return fixed(share.clamp(-highest, highest) * FULL_SCALE_COUNTS);
        }
        let steps = f64::from(1_u32 << (self.bits - 1));
        let step = f64::from(nearest(share.clamp(-1.0, 1.0) * steps));
        fixed(step.min(steps - 1.0) * (FULL_SCALE_COUNTS / steps))
    }
}

fn fixed(counts: f64) -> AdcCounts {
    AdcCounts::from_bits(nearest(counts * 65_536.0))
}

/// The nearest whole number, halves away from zero.
fn nearest(x: f64) -> i32 {
    (x + 0.5_f64.copysign(x)) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensing(bits: u32) -> Sensing {
        Sensing {
            range_a: 40.0,
            bits,
            noise_a: 0.0,
            offset_a: [0.0; 3],
        }
    }

    #[test]
    fn twelve_bits_are_whole_counts() {
        let mut noise = Noise::new(1);
        let sample = sensing(12).sample([1.0, -100.0, 100.0], 24.0, &mut noise);
        assert_eq!(sample.currents[0], AdcCounts::from_num(51));
        assert_eq!(sample.currents[1], AdcCounts::from_num(-2048));
        assert_eq!(sample.currents[2], AdcCounts::from_num(2047));
        assert_eq!(sample.bus, AdcCounts::from_num(1404));
    }

    #[test]
    fn zero_bits_are_exact() {
        let mut noise = Noise::new(1);
        let sample = sensing(0).sample([1.0, 0.0, 0.0], 24.0, &mut noise);
        assert!((sample.currents[0].to_num::<f64>() - 51.2).abs() < 1e-5);
    }
}
