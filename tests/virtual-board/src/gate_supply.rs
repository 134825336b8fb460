//! The supply of a high-side driver: a bootstrap capacitor, which charges while the low side is on.
//!
//! The figures are the L6387E's (data sheet) and the largest capacitor thought possible on the board, since
//! no source gives its value: a smaller one charges sooner.

use crate::time::{CLOCK_HZ, Cycles};

/// The drivers' supply, to which the capacitor charges, V.
const FULL_V: f64 = 10.0;

/// Time constant of the driver's 125 Ω with 1.6 µF, cycles.
const CHARGED_IN: f64 = 125.0 * 1.6e-6 * CLOCK_HZ as f64;

/// Droop due to the driver's 200 µA, V per cycle.
const DRAINED_V: f64 = 200e-6 / 1.6e-6 / CLOCK_HZ as f64;

/// Drop due to a gate's 80 nC, V.
const GATE_V: f64 = 80e-9 / 1.6e-6;

/// Gate voltage that a transistor needs to be on, V: its resistance is specified from there on.
const NEEDED_V: f64 = 6.0;

/// The capacitor, empty at first.
#[derive(Clone, Copy, Debug, Default)]
pub struct GateSupply {
    volts: f64,
    at: Cycles,
}

impl GateSupply {
    /// Advances to a time, until which the low side was on or off.
    pub fn pass(&mut self, low: bool, now: Cycles) {
        let passed = now.saturating_sub(self.at) as f64;
        self.at = now;
        self.volts = if low {
            FULL_V - (FULL_V - self.volts) * (-passed / CHARGED_IN).exp()
        } else {
            (self.volts - DRAINED_V * passed).max(0.0)
        };
    }

    /// Charges the high side's gate. Returns true if the capacitor holds enough to turn it on.
    pub fn turn_on(&mut self) -> bool {
        let enough = self.volts >= NEEDED_V;
        self.volts = (self.volts - GATE_V).max(0.0);
        enough
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const US: Cycles = CLOCK_HZ / 1_000_000;

    /// Creates one whose low side has been on for this long, in 8 µs pulses at 24 kHz.
    fn charged_us(low_us: Cycles) -> GateSupply {
        let mut supply = GateSupply::default();
        let mut now = 0;
        for _ in 0..low_us / 8 {
            supply.pass(false, now);
            now += 8 * US;
            supply.pass(true, now);
            now += 34 * US;
        }
        supply
    }

    #[test]
    fn a_time_constant_is_enough_and_half_of_one_is_not() {
        // 10 V times 1 − e⁻¹, and times 1 − e^−½.
        assert!(charged_us(200).turn_on());
        assert!(!charged_us(100).turn_on());
    }

    /// Creates one whose low side has been on for 50 time constants.
    fn full(now: Cycles) -> GateSupply {
        let mut supply = GateSupply::default();
        supply.pass(true, now);
        supply
    }

    #[test]
    fn it_is_used_up_by_the_gate_and_by_time() {
        let now = 10_000 * US;
        // 4 V at 50 mV each; the last one may go either way.
        let mut supply = full(now);
        let turned_on = (0..200).filter(|_| supply.turn_on()).count();
        assert!((80..=81).contains(&turned_on), "{turned_on}");
        // 4 V at 125 V/s.
        for (off_us, enough) in [(31_000, true), (33_000, false)] {
            let mut supply = full(now);
            supply.pass(false, now + off_us * US);
            assert_eq!(supply.turn_on(), enough, "{off_us} us");
        }
    }
}
