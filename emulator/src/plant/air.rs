//! The surroundings of an ESC and its propeller.

use super::thermal::AMBIENT_C;

/// External influences on one ESC and its motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Air {
    /// Torque on the shaft besides its load's, Nm; positive turns it with the phases in the order a, b, c.
    pub torque_nm: f64,
    /// Wind, as the speed at which it would turn a free propeller, rad/s.
    pub wind_rad_s: f64,
    /// Temperature, °C.
    pub ambient_c: f64,
}

/// Still air at 25 °C.
impl Default for Air {
    fn default() -> Self {
        Self {
            torque_nm: 0.0,
            wind_rad_s: 0.0,
            ambient_c: AMBIENT_C,
        }
    }
}
