//! The currents of a motor without a closed solution: harmonics, saliency, saturation.
//!
//! Classical Runge-Kutta on the currents' flux in the stator's frame, dX/dt = u − R·i − ω·g with
//! ω·g the back-EMF, between two changes of the inverter. The integrals that the period needs are
//! integrated along with it.

use super::circuit::{Circuit, Course, Drive, Moment, Way, confine};
use super::magnetics::Magnetics;
use super::series::rotation;
use super::vector::{AXES, back, dot, turn};

/// Angle of the fastest harmonic per step, rad: the error is 0.2⁵/120, 3e-6 of the harmonic.
const STEP_RAD: f64 = 0.2;

/// Decay of the currents per step: the error is 0.1⁵/120, 1e-7.
const STEP_DECAY: f64 = 0.1;

/// Change of the flux per step relative to that which halves the inductance.
const STEP_BEND: f64 = 0.1;

/// Most steps in a stretch: a motor that would need more makes no sense, and its errors show in the
/// currents rather than in run time.
const STEPS_MAX: f64 = 1e4;

/// Flux X, and the integrals since the start.
type State = [f64; 7];

/// A motor's magnetics with its present speed and resistance.
pub(super) struct Conduction<'a> {
    pub(super) magnetics: &'a Magnetics,
    pub(super) circuit: &'a Circuit,
}

/// Integrals over a stretch.
#[derive(Clone, Copy, Debug)]
struct Flowed {
    /// Integral of the current in the stator's frame, As.
    charge: [f64; 2],
    /// Of its square, A²s.
    square: f64,
    /// Of the torque over 1.5·p, and of its square.
    torque: [f64; 2],
}

impl Conduction<'_> {
    /// Returns the currents and the rotor after a time.
    pub(super) fn at(&self, now: &Moment, drive: &Drive, time_s: f64) -> Moment {
        self.integrate(now, drive, time_s).0
    }

    /// Advances the currents and the rotor, and integrates.
    ///
    /// The period's end takes the torque from i_q, its square from i_q squared, and the copper loss
    /// from both squares: here i_q stands for the torque over φ, and the other square for the
    /// remainder.
    pub(super) fn conduct(&self, course: &mut Course, drive: &Drive, time_s: f64, flux_wb: f64) {
        let (now, flowed) = self.integrate(&course.now, drive, time_s);
        course.go(now);
        let r = self.circuit.resistance_ohm();
        let [torque, torque_square] = flowed.torque;
        let q_square = torque_square / (flux_wb * flux_wb);
        let sums = &mut course.sums;
        sums.q += torque / flux_wb;
        sums.squares[0] += flowed.square - q_square;
        sums.squares[1] += q_square;
        sums.energy += r * dot(drive.u, flowed.charge);
        sums.charge += r * dot(drive.to_bus, flowed.charge);
    }

    fn integrate(&self, now: &Moment, drive: &Drive, time_s: f64) -> (Moment, Flowed) {
        let omega = self.circuit.omega;
        let flux = self.magnetics.flux_wb(now.i);
        let steps = self.steps(now, flux, drive, time_s);
        let h = time_s / steps;
        let half_turn = rotation(0.5 * omega * h);
        let [alpha, beta] = turn(flux, now.direction);
        let mut state = [alpha, beta, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut direction = now.direction;
        for _ in 0..steps as u32 {
            let middle = turn(direction, half_turn);
            let end = turn(middle, half_turn);
            let k1 = self.slope(&state, drive, direction);
            let k2 = self.slope(&ahead(&state, &k1, 0.5 * h), drive, middle);
            let k3 = self.slope(&ahead(&state, &k2, 0.5 * h), drive, middle);
            let k4 = self.slope(&ahead(&state, &k3, h), drive, end);
            for n in 0..state.len() {
                state[n] += h / 6.0 * (k1[n] + 2.0 * (k2[n] + k3[n]) + k4[n]);
            }
            direction = end;
        }
        let [
            alpha,
            beta,
            charge_a,
            charge_b,
            square,
            torque,
            torque_square,
        ] = state;
        let i = self.magnetics.current_a(back([alpha, beta], direction));
        let i = match drive.way {
            Way::Star => i,
            way => back(confine(turn(i, direction), way), direction),
        };
        let flowed = Flowed {
            charge: confine([charge_a, charge_b], drive.way),
            square,
            torque: [torque, torque_square],
        };
        (Moment { i, direction }, flowed)
    }

    /// Returns the number of steps for a time.
    fn steps(&self, now: &Moment, flux: [f64; 2], drive: &Drive, time_s: f64) -> f64 {
        let (magnetics, r) = (self.magnetics, self.circuit.resistance_ohm());
        let length = |[a, b]: [f64; 2]| a.abs() + b.abs();
        let induced_v = magnetics.peak() * self.circuit.emf_v.abs();
        let change = (length(drive.u) + r * length(now.i) + induced_v) * time_s;
        let turned = self.circuit.omega.abs() * magnetics.order() * time_s / STEP_RAD;
        let decayed = magnetics.rate(r, length(flux) + change) * time_s / STEP_DECAY;
        let bent = magnetics.bent(change) / STEP_BEND;
        libm::ceil(turned.max(decayed).max(bent)).clamp(1.0, STEPS_MAX)
    }

    fn slope(&self, state: &State, drive: &Drive, direction: [f64; 2]) -> State {
        if drive.way == Way::Nowhere {
            return [0.0; 7];
        }
        let own = [state[0], state[1]];
        let flux = back(own, direction);
        let i = turn(self.magnetics.current_a(flux), direction);
        let induced = self.magnetics.induced(direction);
        let (r, omega) = (self.circuit.resistance_ohm(), self.circuit.omega);
        let mut v = [0, 1].map(|k| drive.u[k] - r * i[k] - omega * induced[k]);
        if let Way::Without(phase) = drive.way {
            let axis = AXES[phase];
            let held_v = self.magnetics.held_v(axis, flux, v, omega, direction);
            v = [0, 1].map(|k| v[k] + held_v * axis[k]);
        }
        let torque = own[0] * i[1] - own[1] * i[0] + dot(i, induced);
        [v[0], v[1], i[0], i[1], dot(i, i), torque, torque * torque]
    }
}

fn ahead(state: &State, slope: &State, time_s: f64) -> State {
    let mut next = *state;
    for (value, slope) in next.iter_mut().zip(slope) {
        *value += time_s * slope;
    }
    next
}
