//! The bench shared by the drive and the motor.

/// Control and PWM period, s.
pub const PERIOD_S: f64 = 1.0 / 15_000.0;

/// Speed that the drive holds, rpm.
pub const RPM: f64 = 4500.0;

pub(super) const BUS_V: f64 = 24.0;
pub(super) const RESISTANCE_OHM: f64 = 0.108;
pub(super) const INDUCTANCE_H: f64 = 30.6e-6;
pub(super) const FLUX_WB: f64 = 1.3e-3;
pub(super) const POLE_PAIRS: f64 = 12.0;
pub(super) const INERTIA_KGM2: f64 = 1.43e-4;
