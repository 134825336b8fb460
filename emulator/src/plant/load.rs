//! What the shaft turns.

/// A load's torque against the rotation, c1·ω + c2·|ω|·ω (3) and a constant part, and its inertia.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Viscous coefficient, Nm·s/rad.
    pub c1: f64,
    /// Aerodynamic coefficient, Nm·s²/rad².
    pub c2: f64,
    /// Torque that does not depend on the speed, Nm; it falls to zero around standstill.
    pub torque_nm: f64,
    /// Moment of inertia, kg·m².
    pub inertia_kgm2: f64,
}

impl Load {
    /// Torque at a speed, Nm.
    pub fn torque_at(&self, speed_rad_s: f64) -> f64 {
        let magnitude = speed_rad_s.abs();
        // The constant part is smooth over 1 rad/s, so that it does not chatter at rest.
        let constant = self.torque_nm / (magnitude + 1.0);
        (self.c1 + self.c2 * magnitude + constant) * speed_rad_s
    }
}
