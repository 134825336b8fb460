//! A drive's frequency and dead time in timer clocks.

use siskin_control::drive::Config;
use siskin_units::Duty;
use siskin_units::math::Real;

/// Timer settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Timing {
    /// The counter's top: half a period.
    pub(crate) top: u16,
    /// The dead-time generator's code.
    pub(crate) dead_time: u8,
}

impl Timing {
    /// Converts a configuration: the period rounds to an even number of clocks, the dead time up to the
    /// generator's steps.
    pub(crate) fn new(config: &Config, clock_hz: u32) -> Self {
        let period_clocks = clock_hz as f32 * config.scale.period_s;
        let dead_clocks = period_clocks * config.dead_time.share.to_f32();
        Self {
            // The table's 8 to 60 kHz give 10625 to 1400 clocks.
            top: (0.5 * period_clocks + 0.5) as u16,
            // A share 2^-31 too large must not add a step.
            dead_time: dead_time_code((dead_clocks + 0.99) as u16),
        }
    }
}

/// Returns the compare value of a duty, top·duty. A duty has 31 fraction bits, so with twice the top the
/// product's upper half is the result. A duty above 1, which the control does not give, also fills the period.
#[inline(always)] // in each period
pub(crate) const fn compare(duty: Duty, top: u16) -> u32 {
    let product = duty.to_bits() as u64 * (2 * top as u32) as u64;
    (product >> 32) as u32
}

/// Returns the dead-time generator's code for at least this many clocks: steps of 1 up to 127, of 2 up to 254,
/// of 8 up to 504, of 16 up to its maximum of 1008 (5.9 µs at 170 MHz).
const fn dead_time_code(clocks: u16) -> u8 {
    match clocks {
        0..=127 => clocks as u8,
        128..=254 => 0x80 | (clocks.div_ceil(2) - 64) as u8,
        255..=504 => 0xc0 | (clocks.div_ceil(8) - 32) as u8,
        505..=1008 => 0xe0 | (clocks.div_ceil(16) - 32) as u8,
        _ => 0xff,
    }
}

#[cfg(test)]
mod tests {
    use siskin_control::build::build;
    use siskin_params::{
        BOSSO_BENCH, Board, Delay, Greatest, LeastDeadTime, ParamId, Params, Shunts,
    };

    use super::*;

    /// Any board.
    const BOARD: Board = Board {
        image: crate::image::identity("any", 0),
        current_a_per_count: 0.03,
        bus_v_per_count: 0.01,
        current_range_a: 40.0,
        terminal_v_per_count: 0.005,
        shunts: Shunts::Three,
        delay: Delay::One,
        low_side_on_s: 2e-6,
        refresh_s: 3e-6,
        charge_s: 60e-6,
        greatest_phase: Greatest::ANY,
        greatest_supply: Greatest::ANY,
        least_dead_time: LeastDeadTime::NONE,
        pwm_bounds: &[],
    };

    /// Clocks of a code, from the reference manuals (RM0440 and RM0090, TIM1_BDTR.DTG).
    fn clocks(code: u8) -> u16 {
        let code = u16::from(code);
        match code >> 5 {
            0..=3 => code,
            4 | 5 => (64 + (code & 0x3f)) * 2,
            6 => (32 + (code & 0x1f)) * 8,
            _ => (32 + (code & 0x1f)) * 16,
        }
    }

    #[test]
    fn a_dead_time_is_the_next_longer_step() {
        for wanted in 0..=1008 {
            let code = dead_time_code(wanted);
            assert!(clocks(code) >= wanted, "{wanted}");
            assert!(code == 0 || clocks(code - 1) < wanted, "{wanted}");
        }
        assert_eq!(dead_time_code(5000), 0xff);
    }

    #[test]
    fn a_duty_is_its_share_of_the_top() {
        assert_eq!(compare(Duty::ZERO, 3542), 0);
        assert_eq!(compare(Duty::from_num(0.5), 3542), 1771);
        assert_eq!(compare(Duty::from_num(1.0), 3542), 3542);
        // Fits the register at the longest period, so that it is not taken for a small one.
        assert!((10625..1 << 16).contains(&compare(Duty::MAX, 10625)));
    }

    #[test]
    fn parameters_become_clocks() {
        let mut params = Params::of(&BOSSO_BENCH);
        params.set(ParamId::PwmFreqHz, 24_000.0).expect("in range");
        params.set(ParamId::PwmDeadtimeNs, 500.0).expect("in range");
        let config = build(&params, &BOARD).expect("it makes a drive");
        let timing = Timing::new(&config, 170_000_000);
        // 170 MHz / 48 kHz = 3541.7; 0.5 µs are 85 clocks.
        assert_eq!(
            timing,
            Timing {
                top: 3542,
                dead_time: 85
            }
        );
        let timing = Timing::new(&config, 168_000_000);
        assert_eq!(
            timing,
            Timing {
                top: 3500,
                dead_time: 84
            }
        );
    }
}
