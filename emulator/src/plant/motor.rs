//! A permanent-magnet synchronous motor's parameters (1)-(3).

/// A sinusoidal round-rotor motor; phase values of the star.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Phase resistance R, Ω.
    pub resistance_ohm: f64,
    /// Phase inductance L, H.
    pub inductance_h: f64,
    /// Peak phase flux linkage φ, Wb.
    pub flux_wb: f64,
    /// Pole pairs p.
    pub pole_pairs: u32,
    /// Moment of inertia of the rotor, kg·m².
    pub inertia_kgm2: f64,
}
