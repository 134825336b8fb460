//! Level at which hardware turns the bridge off.
//!
//! Nominally 1.6 times `LIM_PHASE_A`, at most the board's rating. The actual trip differs by the tolerances of
//! the board's circuit (figures for the B-G431B-ESC1, 1.71 mV/A at the comparators):
//!
//! | cause | spread |
//! |---|---|
//! | one DAC step, 0.81 mV | 0.47 A, rounded down |
//! | DAC and comparator offset, ±9 mV and ±10 mV (STM32G431 data sheet) | ±11 A at worst |
//! | 1 % resistors around the 129 mV bias | ±1.5 A |
//! | angle of the current vector: a comparator only sees current out of the motor, and the largest of the three is between half and all of the vector's length | 1 to 2 times the level |
//! | break filter, 0.56 µs, and the ringing that it rejects | 0.56 µs of a rise at V/L |
//!
//! A rotating vector passes its worst angle within a sixth of an electrical turn; at standstill the software
//! trip at 1.4 times, which sees both signs of all phases, comes first.

/// The trip relative to `LIM_PHASE_A`.
const TRIP_SHARE: f32 = 1.6;

/// A board's comparators, as they see current out of the motor.
#[derive(Clone, Copy)]
pub(crate) struct TripCircuit {
    /// Zero-current voltage at the comparator.
    pub(crate) bias_v: f32,
    /// Volts per ampere at the comparator.
    pub(crate) v_per_a: f32,
    /// Current rating of the board, peak A.
    pub(crate) rating_a: f32,
    /// Volts per DAC step.
    pub(crate) v_per_step: f32,
}

impl TripCircuit {
    /// Returns the DAC level for a phase current limit of `phase_a`, peak A.
    pub(crate) fn level(&self, phase_a: f32) -> u16 {
        // A NaN limit gives the rating, since `min` returns the other operand.
        let trip_a = (TRIP_SHARE * phase_a).min(self.rating_a).max(0.0);
        let level = (self.bias_v + trip_a * self.v_per_a) / self.v_per_step;
        level as u16
    }

    /// Returns the current at which a level trips, A.
    pub(crate) fn amperes(&self, level: u16) -> f32 {
        (f32::from(level) * self.v_per_step - self.bias_v) / self.v_per_a
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CIRCUIT: TripCircuit = TripCircuit {
        bias_v: 0.1286,
        v_per_a: 0.003 * 4.0 / 7.0,
        rating_a: 40.0,
        v_per_step: 3.3 / 4096.0,
    };

    #[test]
    fn the_level_is_within_a_step_below_1_6_times_the_bound() {
        for tenths in 10..250 {
            let bound = tenths as f32 / 10.0;
            let trip = CIRCUIT.amperes(CIRCUIT.level(bound));
            let wanted = 1.6 * bound;
            assert!(
                (wanted - 0.48..wanted + 0.01).contains(&trip),
                "{bound}: {trip}"
            );
        }
    }

    #[test]
    fn no_bound_takes_it_above_the_rating() {
        for bound in [25.0, 60.0, 1e9, f32::INFINITY, f32::NAN] {
            let trip = CIRCUIT.amperes(CIRCUIT.level(bound));
            assert!((39.5..40.01).contains(&trip), "{bound}: {trip}");
        }
    }
}
