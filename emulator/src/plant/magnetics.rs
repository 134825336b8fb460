//! A motor's magnetic energy: the flux that its currents link, and the back-EMF.
//!
//! The energy of the currents' own flux X in the rotor's frame is 3/2·(w/2 + β·w²/4) with w = X_d²/L_d + X_q²/L_q. Its
//! derivatives are the currents, i = X/L·(1 + β·w): a power series of the flux, as is usual for saturation, with the
//! cross-coupling of the axes that one energy function demands. Voltages and torque follow from the same function, so
//! that no energy is lost between them. Without current X is zero: the magnets' own effect on the iron is in φ and L.

use super::circuit::Circuit;
use super::vector::{AXES, back, dot, phases, turn};
use super::{Extras, Motor};

/// Flux against current, and harmonics.
#[derive(Clone, Debug)]
pub(super) struct Magnetics {
    flux_wb: f64,
    /// 1/L_d and 1/L_q, 1/H.
    inverse_l: [f64; 2],
    /// β, 1/J.
    bend: f64,
    waves: Vec<Wave>,
    /// The highest order of anything that turns with the rotor.
    order: f64,
    /// The greatest phase voltage relative to the fundamental's.
    peak: f64,
}

/// A harmonic of the magnets' flux.
#[derive(Clone, Copy, Debug)]
struct Wave {
    order: u32,
    /// Amplitude of its derivative, Wb.
    flux_wb: f64,
    /// Cosine and sine of its phase.
    phase: [f64; 2],
    /// 1 if it turns with the rotor, −1 against it.
    sense: f64,
}

impl Magnetics {
    /// Creates those of a motor, unless they are the ideal one's.
    pub(super) fn new(motor: &Motor, extras: &Extras) -> Option<Self> {
        if extras.is_linear() {
            return None;
        }
        let ratio = extras.saliency;
        let d_h = 2.0 * motor.inductance_h / (1.0 + ratio);
        let q_h = ratio * d_h;
        // Along q the flux has half its inductance at β·w = 1.
        let half_flux = 0.5 * q_h * extras.saturation_a;
        // Multiples of three are common to the phases.
        let felt = extras.harmonics.iter().filter(|h| h.order % 3 != 0);
        let waves: Vec<_> = felt
            .map(|harmonic| {
                let (sin, cos) = libm::sincos(harmonic.phase_rad);
                Wave {
                    order: harmonic.order,
                    flux_wb: harmonic.share * motor.flux_wb,
                    phase: [cos, sin],
                    sense: if harmonic.order % 3 == 1 { 1.0 } else { -1.0 },
                }
            })
            .collect();
        let shares = waves.iter().map(|wave| wave.flux_wb.abs() / motor.flux_wb);
        Some(Self {
            flux_wb: motor.flux_wb,
            inverse_l: [1.0 / d_h, 1.0 / q_h],
            bend: q_h / (half_flux * half_flux),
            // Saliency turns with twice the rotor's angle.
            order: waves.iter().map(|wave| wave.order).fold(2, u32::max).into(),
            peak: 1.0 + shares.sum::<f64>(),
            waves,
        })
    }

    /// Multiplies the magnets' flux.
    pub(super) fn scale(&mut self, factor: f64) {
        self.flux_wb *= factor;
        self.waves
            .iter_mut()
            .for_each(|wave| wave.flux_wb *= factor);
    }

    /// See [`Self::order`].
    pub(super) fn order(&self) -> f64 {
        self.order
    }

    /// See [`Self::peak`].
    pub(super) fn peak(&self) -> f64 {
        self.peak
    }

    /// Returns the back-EMF over ω, in the stator's frame: the derivative of the magnets' flux by the angle, Wb.
    pub(super) fn induced(&self, direction: [f64; 2]) -> [f64; 2] {
        let [cos, sin] = direction;
        let mut sum = [-self.flux_wb * sin, self.flux_wb * cos];
        for wave in &self.waves {
            let [cos, sin] = turn(power(direction, wave.order), wave.phase);
            sum[0] -= wave.flux_wb * sin;
            sum[1] += wave.flux_wb * wave.sense * cos;
        }
        sum
    }

    /// Returns 1 + β·w at a flux: how much the currents exceed those of the unsaturated motor.
    fn excess(&self, [d, q]: [f64; 2]) -> f64 {
        1.0 + self.bend * (d * d * self.inverse_l[0] + q * q * self.inverse_l[1])
    }

    /// Returns the currents of a flux, in the rotor's frame, A.
    pub(super) fn current_a(&self, flux: [f64; 2]) -> [f64; 2] {
        let excess = self.excess(flux);
        [0, 1].map(|axis| flux[axis] * self.inverse_l[axis] * excess)
    }

    /// Returns the flux of currents, in the rotor's frame, Wb.
    ///
    /// With m = 1 + β·w and w₀ = Σ L·i² it is L·i/m where m³ − m² = β·w₀. Newton's method descends from above, where
    /// the cubic is convex, without passing the root.
    pub(super) fn flux_wb(&self, [d, q]: [f64; 2]) -> [f64; 2] {
        let w = d * d / self.inverse_l[0] + q * q / self.inverse_l[1];
        let target = self.bend * w;
        let mut m = 1.0 + target.min(libm::cbrt(target));
        for _ in 0..60 {
            let next = m - (m * m * (m - 1.0) - target) / (m * (3.0 * m - 2.0));
            if next >= m {
                break;
            }
            m = next;
        }
        [d / (self.inverse_l[0] * m), q / (self.inverse_l[1] * m)]
    }

    /// Returns the fastest decay of currents at a flux of this length, 1/s: R over the least differential inductance.
    pub(super) fn rate(&self, resistance_ohm: f64, flux_wb: f64) -> f64 {
        let bent = self.bent(flux_wb);
        let steepest = self.inverse_l[0].max(self.inverse_l[1]);
        resistance_ohm * steepest * (1.0 + 3.0 * bent * bent)
    }

    /// Returns a flux relative to the least that halves the inductance.
    pub(super) fn bent(&self, flux_wb: f64) -> f64 {
        flux_wb * (self.bend * self.inverse_l[0].max(self.inverse_l[1])).sqrt()
    }

    /// Returns the voltage that an open phase adds along its axis to keep its current at zero, V, where `slope` is the
    /// flux's rate of change without it in the stator's frame, V.
    pub(super) fn held_v(
        &self,
        axis: [f64; 2],
        flux: [f64; 2],
        slope: [f64; 2],
        omega: f64,
        direction: [f64; 2],
    ) -> f64 {
        let [i_d, i_q] = self.current_a(flux);
        let own = back(slope, direction);
        // Seen from the rotor, the stator's frame turns backwards.
        let seen = [own[0] + omega * flux[1], own[1] - omega * flux[0]];
        let [d, q] = self.differential(flux, seen);
        let drift = [d - omega * i_q, q + omega * i_d];
        let axis = back(axis, direction);
        -dot(axis, drift) / dot(axis, self.differential(flux, axis))
    }

    /// Returns the change of the currents from a change of flux, in the rotor's frame, A.
    fn differential(&self, flux: [f64; 2], change: [f64; 2]) -> [f64; 2] {
        let excess = self.excess(flux);
        let linear = [0, 1].map(|axis| flux[axis] * self.inverse_l[axis]);
        let along = 2.0 * self.bend * dot(linear, change);
        [0, 1].map(|axis| change[axis] * self.inverse_l[axis] * excess + along * linear[axis])
    }

    /// Returns each phase's voltage against the star under the voltage vector `u`, V; for an open one among conducting
    /// ones, including what their changing currents couple into it.
    pub(super) fn phases_v(
        &self,
        circuit: &Circuit,
        at: &super::circuit::Moment,
        u: [f64; 2],
        open: Option<usize>,
    ) -> [f64; 3] {
        let induced = self.induced(at.direction).map(|wb| circuit.omega * wb);
        let mut shown = phases(induced);
        if let Some(leg) = open {
            let i = at.stator_a();
            let r = circuit.resistance_ohm();
            let slope = [0, 1].map(|k| u[k] - r * i[k] - induced[k]);
            let (axis, flux) = (AXES[leg], self.flux_wb(at.i));
            shown[leg] = dot(axis, u) + self.held_v(axis, flux, slope, circuit.omega, at.direction);
        }
        shown
    }

    /// Returns the energy in the currents' flux, J.
    #[cfg(test)]
    pub(super) fn stored_j(&self, i: [f64; 2]) -> f64 {
        let flux = self.flux_wb(i);
        let w = (self.excess(flux) - 1.0) / self.bend.max(f64::MIN_POSITIVE);
        let linear = dot(flux, [0, 1].map(|axis| flux[axis] * self.inverse_l[axis]));
        let w = if self.bend > 0.0 { w } else { linear };
        1.5 * (0.5 * w + 0.25 * self.bend * w * w)
    }
}

/// Returns a unit vector's power: its angle times `order`.
fn power(direction: [f64; 2], order: u32) -> [f64; 2] {
    let mut result = [1.0, 0.0];
    let (mut square, mut left) = (direction, order);
    while left > 0 {
        if left & 1 == 1 {
            result = turn(result, square);
        }
        square = turn(square, square);
        left >>= 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::super::Harmonic;
    use super::*;

    const MOTOR: Motor = Motor {
        resistance_ohm: 0.1,
        inductance_h: 30e-6,
        flux_wb: 1.3e-3,
        pole_pairs: 12,
        inertia_kgm2: 0.0,
    };

    fn salient() -> Magnetics {
        let extras = Extras {
            saliency: 1.5,
            saturation_a: 20.0,
            ..Extras::default()
        };
        Magnetics::new(&MOTOR, &extras).unwrap()
    }

    #[test]
    fn an_ideal_motor_needs_none() {
        assert!(Magnetics::new(&MOTOR, &Extras::default()).is_none());
    }

    #[test]
    fn half_the_inductance_is_left_at_the_saturation_current() {
        let magnetics = salient();
        // Mean 30 µH at a ratio of 1.5: 24 and 36.
        for (current_a, wanted_h) in [(0.01, 36e-6), (20.0, 18e-6)] {
            let [_, q] = magnetics.flux_wb([0.0, current_a]);
            assert!((q / current_a / wanted_h - 1.0).abs() < 1e-5);
        }
        let [d, _] = magnetics.flux_wb([0.01, 0.0]);
        assert!((d / 0.01 / 24e-6 - 1.0).abs() < 1e-5);
    }

    #[test]
    fn flux_and_current_are_each_other_s_inverse() {
        let magnetics = salient();
        for d in [-200.0, -3.0, 0.0, 1e-6, 40.0] {
            for q in [-50.0, 0.0, 0.5, 300.0] {
                let [back_d, back_q] = magnetics.current_a(magnetics.flux_wb([d, q]));
                let apart = (back_d - d).abs().max((back_q - q).abs());
                assert!(
                    apart <= 1e-13 * (1.0 + d.abs() + q.abs()),
                    "{d} {q}: {apart}"
                );
            }
        }
    }

    /// The currents are the derivatives of the energy, which makes the coupling of the axes symmetric.
    #[test]
    fn the_currents_are_the_energy_s_slopes() {
        let magnetics = salient();
        let energy = |flux| magnetics.stored_j(magnetics.current_a(flux)) / 1.5;
        let at: [f64; 2] = [2.5e-4, -4e-4];
        let h = 1e-8;
        let slope_d = (energy([at[0] + h, at[1]]) - energy([at[0] - h, at[1]])) / (2.0 * h);
        let slope_q = (energy([at[0], at[1] + h]) - energy([at[0], at[1] - h])) / (2.0 * h);
        let [d, q] = magnetics.current_a(at);
        assert!((slope_d / d - 1.0).abs() < 1e-6 && (slope_q / q - 1.0).abs() < 1e-6);
        let [change_d, change_q] = magnetics.differential(at, [1e-9, 2e-9]);
        let [next_d, next_q] = magnetics.current_a([at[0] + 1e-9, at[1] + 2e-9]);
        assert!((change_d / (next_d - d) - 1.0).abs() < 1e-4);
        assert!((change_q / (next_q - q) - 1.0).abs() < 1e-4);
    }

    /// Each phase has the same wave a third of a turn later, apart from what all have in common.
    #[test]
    fn harmonics_are_the_same_wave_in_every_phase() {
        let harmonic = |order, share, phase_rad| Harmonic {
            order,
            share,
            phase_rad,
        };
        let harmonics = vec![
            harmonic(3, 0.2, 0.0),
            harmonic(5, 0.05, 0.4),
            harmonic(7, 0.03, -1.0),
            harmonic(11, 0.01, 2.0),
        ];
        let extras = Extras {
            harmonics: harmonics.clone(),
            ..Extras::default()
        };
        let magnetics = Magnetics::new(&MOTOR, &extras).unwrap();
        for k in 0..50 {
            let angle = TAU * f64::from(k) / 50.0;
            let shown = phases(magnetics.induced([angle.cos(), angle.sin()]));
            for (phase, shown) in shown.into_iter().enumerate() {
                let angle = angle - TAU * phase as f64 / 3.0;
                let felt = harmonics.iter().filter(|h| h.order != 3);
                let wave: f64 = felt
                    .map(|h| h.share * (f64::from(h.order) * angle + h.phase_rad).sin())
                    .sum();
                let wanted = -MOTOR.flux_wb * (angle.sin() + wave);
                assert!((shown - wanted).abs() < 1e-12 * MOTOR.flux_wb + 1e-15);
            }
        }
    }
}
