//! Temperatures.

use siskin_control::protection::Ntc;
use siskin_units::AdcCounts;

use super::Winding;

/// Initial temperature of everything, and that of the surroundings, °C.
pub(super) const AMBIENT_C: f64 = 25.0;

/// Temperature coefficient of copper's resistance, 1/K.
const COPPER_PER_K: f64 = 3.93e-3;

/// Resistance of a phase's current path, through one of two transistors and their shunt: about 6 mΩ.
const PATH_OHM: f64 = 6e-3;

/// Thermal resistance of a small board to moving air, K/W.
pub const BOARD_K_PER_W: f64 = 6.0;

/// Its time constant, s.
const BOARD_S: f64 = 20.0;

/// Time constant of the sensor, which lies beside the transistors and follows the board, s.
const SENSOR_S: f64 = 2.0;

/// The sensor of the simulated board.
const NTC: Ntc = Ntc::VESC;

/// The board with its transistors, and the sensor beside them.
#[derive(Clone, Copy, Debug)]
pub struct Thermal {
    /// From the board to the air, K/W.
    k_per_w: f64,
    /// Temperature of the board, °C.
    board_c: f64,
    /// Temperature of the sensor, °C.
    sensor_c: f64,
    /// Ambient temperature, °C.
    ambient_c: f64,
}

impl Thermal {
    /// Starts at ambient temperature, with this thermal resistance from the board to the air, K/W.
    pub const fn new(k_per_w: f64) -> Self {
        Self {
            k_per_w,
            board_c: AMBIENT_C,
            sensor_c: AMBIENT_C,
            ambient_c: AMBIENT_C,
        }
    }

    /// Changes the ambient temperature, °C.
    pub fn set_ambient_c(&mut self, ambient_c: f64) {
        self.ambient_c = ambient_c;
    }

    /// Advances the temperatures by `time_s`, short against 2 s, at the mean square of a current vector, A².
    pub fn advance(&mut self, time_s: f64, current_square: f64) {
        let heat_w = 1.5 * PATH_OHM * current_square;
        let settled_c = self.ambient_c + self.k_per_w * heat_w;
        self.board_c += (settled_c - self.board_c) * (time_s * (1.0 / BOARD_S));
        self.sensor_c += (self.board_c - self.sensor_c) * (time_s * (1.0 / SENSOR_S));
    }

    /// Returns the sensor's temperature, °C.
    pub fn sensor_c(&self) -> f64 {
        self.sensor_c
    }

    /// Returns the converter's reading of the sensor's divider: 12 bits.
    fn counts(&self) -> AdcCounts {
        let per_k = 1.0 / (self.sensor_c + 273.15) - 1.0 / 298.15;
        let thermistor = libm::exp(f64::from(NTC.beta_k) * per_k);
        let pull_down = f64::from(NTC.pull_down);
        let share = pull_down / (pull_down + thermistor);
        AdcCounts::from_num(libm::round(4096.0 * share).min(4095.0))
    }

    /// Returns the board's temperature as the control measures it, °C.
    pub fn measured_c(&self) -> f32 {
        NTC.celsius(self.counts())
    }
}

impl Default for Thermal {
    fn default() -> Self {
        Self::new(BOARD_K_PER_W)
    }
}

/// A winding heated by copper loss, whose resistance grows with it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Warming {
    winding: Winding,
    /// Resistance at 25 °C, Ω.
    cold_ohm: f64,
    /// Above 25 °C: of the surroundings, and its own above them, K.
    ambient_k: f64,
    excess_k: f64,
}

impl Warming {
    pub(super) const fn new(winding: Winding, cold_ohm: f64) -> Self {
        Self {
            winding,
            cold_ohm,
            ambient_k: 0.0,
            excess_k: 0.0,
        }
    }

    /// Changes the ambient temperature, °C. The winding's own does not change.
    pub(super) fn set_ambient_c(&mut self, ambient_c: f64) {
        let ambient_k = ambient_c - AMBIENT_C;
        self.excess_k += self.ambient_k - ambient_k;
        self.ambient_k = ambient_k;
    }

    /// Multiplies its resistance.
    pub(super) fn scale(&mut self, factor: f64) {
        self.cold_ohm *= factor;
    }

    /// Heats the winding for a time short against its time constant; returns its resistance then, Ω.
    pub(super) fn advance(&mut self, time_s: f64, copper_w: f64) -> f64 {
        let heat_w = copper_w - self.excess_k / self.winding.resistance_k_per_w;
        self.excess_k += heat_w * time_s / self.winding.capacity_j_per_k;
        self.cold_ohm * (1.0 + COPPER_PER_K * (self.ambient_k + self.excess_k))
    }

    /// Returns the temperature, °C.
    pub(super) fn temperature_c(&self) -> f64 {
        AMBIENT_C + self.ambient_k + self.excess_k
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sensor_follows_the_board() {
        let mut thermal = Thermal::default();
        let mut advance = |time_s: f64, current_a| {
            for _ in 0..(time_s / 1e-3) as u32 {
                thermal.advance(1e-3, current_a * current_a);
            }
            (thermal.board_c, thermal.sensor_c)
        };
        // 30 A is 8.1 W.
        let (board_c, sensor_c) = advance(1.0, 30.0);
        assert!(board_c > sensor_c && sensor_c > 25.0 && board_c < 28.0);
        // In the end the board is 48.6 K warmer, and so is the sensor.
        let (board_c, sensor_c) = advance(200.0, 30.0);
        assert!((board_c - 73.6).abs() < 0.1 && (sensor_c - 73.6).abs() < 0.1);
    }

    #[test]
    fn a_board_with_a_heat_sink_stays_cooler() {
        let mut thermal = Thermal::new(0.6);
        (0..200_000).for_each(|_| thermal.advance(1e-3, 900.0));
        // A tenth of the 48.6 K of a small board.
        assert!((thermal.sensor_c() - 29.86).abs() < 0.1);
    }

    #[test]
    fn what_the_control_makes_of_the_reading_is_the_sensor_s_temperature() {
        let mut thermal = Thermal::default();
        for sensor_c in [0.0, 25.0, 60.0, 100.0, 125.0] {
            thermal.sensor_c = sensor_c;
            let shown_c = f64::from(thermal.measured_c());
            // A count is 0.3 K at 100 °C.
            assert!((shown_c - sensor_c).abs() < 0.5, "{shown_c} for {sensor_c}");
        }
    }

    #[test]
    fn the_surroundings_warm_board_and_winding() {
        let mut thermal = Thermal::default();
        thermal.set_ambient_c(60.0);
        (0..200_000).for_each(|_| thermal.advance(1e-3, 0.0));
        assert!((thermal.sensor_c() - 60.0).abs() < 0.1);
        let winding = Winding {
            resistance_k_per_w: 5.0,
            capacity_j_per_k: 10.0,
        };
        let mut warming = Warming::new(winding, 0.1);
        warming.set_ambient_c(60.0);
        assert!(
            (warming.temperature_c() - 25.0).abs() < 1e-9,
            "at once it is as warm as before"
        );
        (0..500_000).for_each(|_| {
            warming.advance(1e-3, 0.0);
        });
        assert!((warming.temperature_c() - 60.0).abs() < 0.01);
    }

    #[test]
    fn a_winding_warms_up_and_its_resistance_with_it() {
        let winding = Winding {
            resistance_k_per_w: 5.0,
            capacity_j_per_k: 10.0,
        };
        let mut warming = Warming::new(winding, 0.1);
        let mut ohm = 0.1;
        for _ in 0..50_000 {
            ohm = warming.advance(1e-3, 16.0);
        }
        // After one time constant, 50 s, 63.2 % of 80 K.
        let excess_k = 80.0 * (1.0 - (-1.0_f64).exp());
        assert!((warming.temperature_c() - 25.0 - excess_k).abs() < 0.01);
        assert!((ohm - 0.1 * (1.0 + 0.00393 * excess_k)).abs() < 1e-5);
    }
}
