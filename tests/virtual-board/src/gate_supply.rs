//! The supply of a high side's driver: a bootstrap capacitor, which is charged while the low side is on.
//!
//! The figures are the L6387E's (its data sheet) and the greatest capacitor that is taken for possible on the
//! board, as no source has its value: a smaller one is charged sooner.

use crate::time::{CLOCK_HZ, Cycles};

/// The drivers' supply, to which the capacitor is charged, V.
const FULL_V: f64 = 10.0;

/// Time constant of the driver's 125 Ω and 1.6 µF, cycles.
const CHARGED_IN: f64 = 125.0 * 1.6e-6 * CLOCK_HZ as f64;

/// What the driver's 200 µA take of it, V a cycle.
const DRAINED_V: f64 = 200e-6 / 1.6e-6 / CLOCK_HZ as f64;

/// What 80 nC of a gate take of it, V.
const GATE_V: f64 = 80e-9 / 1.6e-6;

/// What a transistor needs at its gate to be on, V: its resistance is stated from there on.
const NEEDED_V: f64 = 6.0;

/// The capacitor. It is empty at first.
#[derive(Clone, Copy, Debug, Default)]
pub struct GateSupply {
    volts: f64,
    at: Cycles,
}

impl GateSupply {
    /// Comes to a time, until which the low side was on or off.
    pub fn pass(&mut self, low: bool, now: Cycles) {
        let passed = now.saturating_sub(self.at) as f64;
        self.at = now;
        self.volts = if low {
            FULL_V - (FULL_V - self.volts) * (-passed / CHARGED_IN).exp()
        } else {
            (self.volts - DRAINED_V * passed).max(0.0)
        };
    }

    /// The high side's gate is charged from it. Returns true if that is enough to turn it on.
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

    /// One whose low side has been on for so long in pulses of 8 µs at 24 kHz.
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
        // 10 V by 1 − e⁻¹, and by 1 − e^−½.
        assert!(charged_us(200).turn_on());
        assert!(!charged_us(100).turn_on());
    }

    /// One whose low side has been on for 50 time constants.
    fn full(now: Cycles) -> GateSupply {
        let mut supply = GateSupply::default();
        supply.pass(true, now);
        supply
    }

    #[test]
    fn it_is_used_up_by_the_gate_and_by_time() {
        let now = 10_000 * US;
        // 4 V by 50 mV each; the last one may be either way.
        let mut supply = full(now);
        let turned_on = (0..200).filter(|_| supply.turn_on()).count();
        assert!((80..=81).contains(&turned_on), "{turned_on}");
        // 4 V by 125 V/s.
        for (off_us, enough) in [(31_000, true), (33_000, false)] {
            let mut supply = full(now);
            supply.pass(false, now + off_us * US);
            assert_eq!(supply.turn_on(), enough, "{off_us} us");
        }
    }
}
