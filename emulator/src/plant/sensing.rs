//! Converts the plant's quantities to ADC counts.

use siskin_control::drive::Sample;
use siskin_params::{Board, Delay, Greatest, Image, LeastDeadTime, Shunts};
use siskin_units::AdcCounts;

use super::Noise;
use super::vector::{AXES, dot, phases, turn};

/// Counts from zero to full scale of the control's converter, whatever the simulated resolution.
const FULL_SCALE_COUNTS: f64 = 2048.0;

/// Fraction bits of a count.
const COUNT_BITS: u32 = AdcCounts::FRAC_NBITS;

/// Full scale of the supply's and of the terminals' dividers, V.
const VOLTAGE_RANGE_V: f64 = 70.0;

/// Counts at full scale of a voltage reading.
const VOLTAGE_COUNTS: f64 = 4096.0;

/// The sensors and their converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensing {
    /// Full scale of the currents, ± amperes.
    pub range_a: f64,
    /// Resolution, bits with sign; 0 is exact.
    pub bits: u32,
    /// Noise, A rms.
    pub noise_a: f64,
    /// Zero error of each phase, A.
    pub offset_a: [f64; 3],
    /// Gain of each phase's current.
    pub gain: [f64; 3],
    /// Time constant of the shunt amplifiers, s.
    pub settling_s: f64,
    /// Electrical degrees by which each Hall sensor switches late in forward rotation.
    pub hall_error_deg: [f64; 3],
}

/// What there is to sense at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Currents into the phases, A.
    pub currents_a: [f64; 3],
    /// How long each has been flowing through its low side, s; `None` if it does not.
    pub low_s: [Option<f64>; 3],
    /// Voltages of the terminals, V.
    pub terminals_v: [f64; 3],
    /// Voltage of the supply, V.
    pub bus_v: f64,
    /// Cosine and sine of the electrical angle.
    pub direction: [f64; 2],
}

impl Default for Sensing {
    /// 12 bits over ±40 A and 0.05 A of noise.
    fn default() -> Self {
        Self {
            range_a: 40.0,
            bits: 12,
            noise_a: 0.05,
            offset_a: [0.0; 3],
            gain: [1.0; 3],
            // An amplifier of 1.6 MHz: after the half microsecond that the board leaves at the greatest duty it has
            // settled to 1 %. Written as a scenario's nanoseconds are converted, for equal bits.
            settling_s: 100.0 * 1e-9,
            hall_error_deg: [0.0; 3],
        }
    }
}

impl Sensing {
    /// Returns the board that these sensors make, for [`siskin_control::build::build`].
    pub fn board(&self, delay: Delay) -> Board {
        Board {
            image: Image::EMULATOR,
            current_a_per_count: (self.range_a / FULL_SCALE_COUNTS) as f32,
            bus_v_per_count: (VOLTAGE_RANGE_V / VOLTAGE_COUNTS) as f32,
            terminal_v_per_count: (VOLTAGE_RANGE_V / VOLTAGE_COUNTS) as f32,
            current_range_a: self.range_a as f32,
            greatest_phase: Board::greatest_phase(self.range_a as f32),
            greatest_supply: Greatest::ANY,
            shunts: Shunts::Three,
            delay,
            low_side_on_s: 1e-6,
            refresh_s: 1e-6,
            charge_s: 63e-6,
            least_dead_time: LeastDeadTime::NONE,
            pwm_bounds: &[],
        }
    }

    /// Takes one sample of everything.
    #[inline] // in each period
    pub fn sample(&self, truth: &Truth, noise: &mut Noise) -> Sample {
        let per_a = 1.0 / self.range_a;
        let mut currents = [AdcCounts::ZERO; 3];
        for (phase, counts) in currents.iter_mut().enumerate() {
            *counts = self.quantised(self.shown_a(truth, phase, noise) * per_a);
        }
        Sample {
            currents,
            bus: self.voltage(truth.bus_v),
            terminals: truth.terminals_v.map(|terminal_v| self.voltage(terminal_v)),
            hall: self.hall(truth.direction),
        }
    }

    /// Returns a phase sensor's output before conversion, A.
    #[inline] // in each period
    pub fn shown_a(&self, truth: &Truth, phase: usize, noise: &mut Noise) -> f64 {
        let current_a = self.shunt_a(truth, phase) + self.offset_a[phase];
        if self.noise_a > 0.0 {
            current_a + self.noise_a * noise.gaussian()
        } else {
            current_a
        }
    }

    /// Returns the reading of a sensor stuck at a current, A.
    pub fn stuck(&self, current_a: f64) -> AdcCounts {
        self.quantised(current_a / self.range_a)
    }

    /// Returns a low side amplifier's output, A: it starts from zero when the current enters the shunt.
    fn shunt_a(&self, truth: &Truth, phase: usize) -> f64 {
        let Some(on_s) = truth.low_s[phase] else {
            return 0.0;
        };
        let settled_a = truth.currents_a[phase] * self.gain[phase];
        // Fully settled after 40 time constants.
        if on_s >= 40.0 * self.settling_s {
            settled_a
        } else {
            settled_a * (1.0 - libm::exp(-on_s / self.settling_s))
        }
    }

    /// Returns a divider's reading of a voltage, saturated.
    fn voltage(&self, volts: f64) -> AdcCounts {
        // The case of the low sides' terminals.
        if volts == 0.0 {
            return AdcCounts::ZERO;
        }
        let counts = (volts * (VOLTAGE_COUNTS / VOLTAGE_RANGE_V)).clamp(0.0, VOLTAGE_COUNTS - 1.0);
        if self.bits == 0 {
            fixed(counts)
        } else {
            AdcCounts::from_bits(nearest(counts) << COUNT_BITS)
        }
    }

    /// Returns the Hall sensors' bits.
    #[inline(always)] // in each period
    pub fn hall(&self, direction: [f64; 2]) -> u8 {
        let mut through = phases(direction);
        for (phase, through) in through.iter_mut().enumerate() {
            let error_deg = self.hall_error_deg[phase];
            if error_deg != 0.0 {
                let (sin, cos) = libm::sincos(error_deg.to_radians());
                *through = dot(turn(AXES[phase], [cos, sin]), direction);
            }
        }
        let [a, b, c] = through.map(|through| u8::from(through > 0.0));
        a | b << 1 | c << 2
    }

    /// Converts a share of full scale to counts, rounded to the resolution and saturated.
    fn quantised(&self, share: f64) -> AdcCounts {
        if self.bits == 0 {
            let highest = 1.0 - 1.0 / FULL_SCALE_COUNTS;
            return fixed(share.clamp(-highest, highest) * FULL_SCALE_COUNTS);
        }
        let steps = 1_i32 << (self.bits - 1);
        let step = nearest(share.clamp(-1.0, 1.0) * f64::from(steps)).min(steps - 1);
        // One step is 2048/2^(bits − 1) counts.
        AdcCounts::from_bits(step << (COUNT_BITS + 12 - self.bits))
    }
}

fn fixed(counts: f64) -> AdcCounts {
    AdcCounts::from_bits(nearest(counts * f64::from(1 << COUNT_BITS)))
}

/// Rounds to the nearest whole number, ties to even: next to 1.5·2^52 a double has no bits for more, and the number is
/// in its lowest ones. Several times faster than a conversion, for any size and NaN.
#[inline(always)] // in each period
fn nearest(x: f64) -> i32 {
    (x + 6_755_399_441_055_744.0).to_bits() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sensing(bits: u32) -> Sensing {
        Sensing {
            bits,
            noise_a: 0.0,
            ..Sensing::default()
        }
    }

    fn truth(currents_a: [f64; 3]) -> Truth {
        Truth {
            currents_a,
            low_s: [Some(1.0); 3],
            terminals_v: [0.0; 3],
            bus_v: 24.0,
            direction: [1.0, 0.0],
        }
    }

    fn sample(sensing: Sensing, truth: Truth) -> Sample {
        sensing.sample(&truth, &mut Noise::new(1))
    }

    #[test]
    fn twelve_bits_are_whole_counts() {
        let sample = sample(sensing(12), truth([1.0, -100.0, 100.0]));
        assert_eq!(sample.currents[0], AdcCounts::from_num(51));
        assert_eq!(sample.currents[1], AdcCounts::from_num(-2048));
        assert_eq!(sample.currents[2], AdcCounts::from_num(2047));
        assert_eq!(sample.bus, AdcCounts::from_num(1404));
    }

    #[test]
    fn zero_bits_are_exact() {
        let sample = sample(sensing(0), truth([1.0, 0.0, 0.0]));
        assert!((sample.currents[0].to_num::<f64>() - 51.2).abs() < 1e-5);
    }

    #[test]
    fn a_shunt_shows_what_its_low_side_carries() {
        let sensing = Sensing {
            offset_a: [0.0, 0.0, 0.5],
            gain: [1.02, 1.0, 1.0],
            settling_s: 0.2e-6,
            ..sensing(0)
        };
        let truth = Truth {
            low_s: [Some(1.0), Some(0.2e-6), None],
            ..truth([10.0, 10.0, -20.0])
        };
        let counts_per_a = 2048.0 / 40.0;
        let shown = sample(sensing, truth).currents;
        let shown = shown.map(|counts| counts.to_num::<f64>() / counts_per_a);
        // One time constant leaves 1/e; a high side's current passes no shunt, its offset stays.
        let wanted = [10.2, 10.0 * (1.0 - (-1.0_f64).exp()), 0.5];
        for (shown, wanted) in shown.into_iter().zip(wanted) {
            assert!((shown - wanted).abs() < 1e-5, "{shown} for {wanted}");
        }
    }

    #[test]
    fn terminals_are_read_within_their_divider() {
        let truth = Truth {
            terminals_v: [-0.7, 24.0, 80.0],
            ..truth([0.0; 3])
        };
        let sample = sample(sensing(12), truth);
        // 24/70·4096 = 1404.3.
        assert_eq!(sample.terminals, [0, 1404, 4095].map(AdcCounts::from_num));
    }

    #[test]
    fn hall_sensors_show_the_sign_of_the_flux_through_their_phase() {
        let sensing = Sensing {
            hall_error_deg: [0.0, 5.0, 0.0],
            ..sensing(12)
        };
        for degrees in 0..360 {
            let angle = (f64::from(degrees) + 0.5).to_radians();
            let truth = Truth {
                direction: [angle.cos(), angle.sin()],
                ..truth([0.0; 3])
            };
            let positive = |late_deg: f64, phase: f64| {
                let from_axis = f64::from(degrees) + 0.5 - late_deg - 120.0 * phase;
                (from_axis.to_radians()).cos() > 0.0
            };
            let wanted = u8::from(positive(0.0, 0.0))
                | u8::from(positive(5.0, 1.0)) << 1
                | u8::from(positive(0.0, 2.0)) << 2;
            assert_eq!(sample(sensing, truth).hall, wanted, "{degrees}");
        }
    }
}
