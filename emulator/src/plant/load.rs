//! What the shaft drives.

/// A load's torque against the rotation, c1·ω + c2·|ω|·ω (3) plus a constant part, and its inertia.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Viscous coefficient, Nm·s/rad.
    pub c1: f64,
    /// Aerodynamic coefficient, Nm·s²/rad².
    pub c2: f64,
    /// Torque independent of speed, Nm; it falls to zero around standstill.
    pub torque_nm: f64,
    /// Moment of inertia, kg·m².
    pub inertia_kgm2: f64,
}

impl Load {
    /// Returns the torque against the rotation divided by the speed, Nm·s/rad.
    pub fn damping_at(&self, speed_rad_s: f64) -> f64 {
        let magnitude = speed_rad_s.abs();
        // The constant part is smoothed over 1 rad/s, so that it does not chatter at rest.
        self.c1 + self.c2 * magnitude + self.torque_nm / (magnitude + 1.0)
    }
}
