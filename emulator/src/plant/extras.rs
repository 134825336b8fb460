//! How a real motor departs from the ideal one.

/// Departures from a sinusoidal, round, unsaturated, frictionless and cool motor; none by default.
#[derive(Clone, Debug, PartialEq)]
pub struct Extras {
    /// Harmonics of the back-EMF.
    pub harmonics: Vec<Harmonic>,
    /// L_q/L_d; their mean is the motor's inductance. 1 is a round rotor.
    pub saliency: f64,
    /// Current along q at which the inductance has halved, A; infinite means no saturation.
    pub saturation_a: f64,
    /// What brakes the shaft.
    pub drag: Drag,
    /// Its detents.
    pub cogging: Cogging,
    /// How the winding heats up, if it does.
    pub winding: Option<Winding>,
}

/// A harmonic of the back-EMF: with the fundamental −ωφ·sin θ, phase a gets −share·ωφ·sin(order·θ +
/// phase).
///
/// Order 5 turns against the rotor and 7 with it. Multiples of three are the same in all phases:
/// they move the star point, which is not connected, and show at no terminal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Harmonic {
    /// Order, 2 and above.
    pub order: u32,
    /// Amplitude as a share of the fundamental's.
    pub share: f64,
    /// Phase, rad.
    pub phase_rad: f64,
}

/// Torque against the rotation that the motor itself loses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drag {
    /// Dry friction of the bearings, Nm.
    pub friction_nm: f64,
    /// Viscous friction, Nm·s/rad.
    pub viscous_nms: f64,
    /// Hysteresis of the iron, whose loss grows with speed, Nm.
    pub hysteresis_nm: f64,
    /// Eddy currents of the iron, whose loss grows with speed squared, Nm·s/rad.
    pub eddy_nms: f64,
}

/// The magnets' pull towards the teeth: −torque·sin(order·θ) at the mechanical angle θ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cogging {
    /// Amplitude, Nm.
    pub torque_nm: f64,
    /// Detents per mechanical turn: usually the least common multiple of poles and slots.
    pub order: u32,
}

/// The winding as one thermal mass heated by copper loss.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winding {
    /// To the surroundings, K/W.
    pub resistance_k_per_w: f64,
    /// J/K.
    pub capacity_j_per_k: f64,
}

impl Default for Extras {
    fn default() -> Self {
        Self {
            harmonics: Vec::new(),
            saliency: 1.0,
            saturation_a: f64::INFINITY,
            drag: Drag::default(),
            cogging: Cogging::default(),
            winding: None,
        }
    }
}

impl Extras {
    /// Returns true if the currents obey the ideal motor's linear equation.
    pub fn is_linear(&self) -> bool {
        self.harmonics.is_empty() && self.saliency == 1.0 && self.saturation_a == f64::INFINITY
    }

    /// Returns true if only currents and load move the shaft.
    pub(super) fn runs_freely(&self) -> bool {
        self.drag == Drag::default() && self.cogging == Cogging::default()
    }
}
