//! The board's temperature.

/// One thermal mass at the transistors, heated by their resistance.
#[derive(Clone, Copy, Debug)]
pub struct Thermal {
    /// Temperature, °C.
    pub temperature_c: f64,
}

const AMBIENT_C: f64 = 25.0;

/// Two transistors and their shunts carry each phase's current in turn: about 6 mΩ.
const PATH_OHM: f64 = 6e-3;

/// A small board in moving air.
const RESISTANCE_K_PER_W: f64 = 6.0;

/// Its time constant, s.
const TIME_CONSTANT_S: f64 = 20.0;

impl Thermal {
    /// At the temperature of the surroundings.
    pub const fn new() -> Self {
        Self {
            temperature_c: AMBIENT_C,
        }
    }

    /// Takes the temperature on by `time_s`, short against 20 s, at a current vector's magnitude.
    pub fn advance(&mut self, time_s: f64, current_a: f64) {
        let heat_w = 1.5 * PATH_OHM * current_a * current_a;
        let settled_c = AMBIENT_C + RESISTANCE_K_PER_W * heat_w;
        self.temperature_c += (settled_c - self.temperature_c) * (time_s / TIME_CONSTANT_S);
    }
}

impl Default for Thermal {
    fn default() -> Self {
        Self::new()
    }
}
