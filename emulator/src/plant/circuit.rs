//! The stator's circuit at constant speed.
//!
//! Between two changes of the inverter the currents obey a linear equation with a constant and a
//! rotating input, L·di/dt = u − R·i − jωφ·e^(jθ) (1), (2), in the stator's frame. It has a closed
//! solution: i − s decays with R/L towards u/R, where s = −jωφ·e^(jθ)/(R + jωL) turns with the
//! rotor. With one phase open the current stays on the line perpendicular to that phase's axis, and
//! as every coefficient is scalar, its solution is the projection of the full one on that line.

mod mean;
mod sweep;

pub(super) use sweep::Sweep;

use super::Motor;
use super::series::{DECAY_MAX, ROTATION_MAX, rotation, small_decay, small_rotation};
use super::vector::{AXES, back, dot, largest, turn};

/// Which currents can flow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// All.
    Star,
    /// All but this phase's.
    Without(usize),
    /// None.
    Nowhere,
}

/// What the inverter applies to the motor until its next change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drive {
    /// Voltage vector in the stator's frame, V.
    pub(super) u: [f64; 2],
    /// The current vector times this gives the supply current.
    pub(super) to_bus: [f64; 2],
    /// Which currents flow.
    pub(super) way: Way,
}

/// An interval within a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// Its length, s.
    pub(super) time_s: f64,
    /// Cosine and sine of the angle that the rotor turns.
    rotation: [f64; 2],
    /// The remaining share of a transient.
    decay: f64,
}

impl Stretch {
    /// Returns one twice as long.
    #[inline(always)] // in each period
    pub(super) fn twice(&self) -> Self {
        Self {
            time_s: 2.0 * self.time_s,
            rotation: turn(self.rotation, self.rotation),
            decay: self.decay * self.decay,
        }
    }
}

/// The currents and the rotor's direction at some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    /// i_d and i_q, A.
    pub(super) i: [f64; 2],
    /// Cosine and sine of the electrical angle.
    pub(super) direction: [f64; 2],
}

impl Moment {
    /// Returns the current vector in the stator's frame, A.
    #[inline(always)] // in each period
    pub(super) fn stator_a(&self) -> [f64; 2] {
        turn(self.i, self.direction)
    }
}

/// The result of a stretch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Solution {
    /// Its end.
    pub(super) end: Moment,
    /// u/R in the rotor's frame at its start and end, A.
    settled: [[f64; 2]; 2],
}

/// Integrals over the period so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sums {
    /// i_q, As.
    pub(super) q: f64,
    /// i_d² and i_q², A²s.
    pub(super) squares: [f64; 2],
    /// Energy into the motor, times R/1.5, V²s.
    pub(super) energy: f64,
    /// Charge from the supply, times R, Vs.
    pub(super) charge: f64,
}

/// The circuit's progress in a period.
#[derive(Clone, Copy, Debug)]
pub(super) struct Course {
    /// The currents and the rotor now.
    pub(super) now: Moment,
    /// Integrals so far.
    pub(super) sums: Sums,
    /// Greatest magnitude of a phase current so far, A.
    pub(super) most_a: f64,
}

impl Course {
    /// Advances to a stretch's end.
    #[inline(always)] // in each period
    pub(super) fn go(&mut self, to: Moment) {
        self.now = to;
        self.reach(largest(to.stator_a()));
    }

    /// Records a phase current, A.
    // By comparison: `max` checks for NaN.
    #[inline(always)] // in each period
    pub(super) fn reach(&mut self, current_a: f64) {
        if current_a > self.most_a {
            self.most_a = current_a;
        }
    }
}

/// The circuit at one speed, in a form that needs no division.
#[derive(Clone, Copy, Debug)]
pub(super) struct Circuit {
    /// Electrical speed ω, rad/s.
    pub(super) omega: f64,
    /// Amplitude of the back-EMF in a phase, with the sign of ω, V.
    pub(super) emf_v: f64,
    /// The current that turns with the rotor, in the rotor's frame, A.
    turning: [f64; 2],
    resistance_ohm: f64,
    inductance_h: f64,
    flux_wb: f64,
    /// The current that would link as much flux as the magnets, φ/L, A.
    magnet_a: f64,
    /// 1/R, 1/Ω.
    pub(super) inverse_r: f64,
    /// 1/|R + jωL|², 1/Ω².
    inverse_z_square: f64,
    /// R/L, 1/s.
    rate: f64,
    /// Whether the series of decay and of rotation are valid for half a period.
    short: [bool; 2],
}

impl Circuit {
    /// Creates the circuit of a motor at rest.
    pub(super) fn new(motor: &Motor) -> Self {
        let (r, l) = (motor.resistance_ohm, motor.inductance_h);
        Self {
            omega: 0.0,
            emf_v: 0.0,
            turning: [0.0; 2],
            resistance_ohm: r,
            inductance_h: l,
            flux_wb: motor.flux_wb,
            magnet_a: motor.flux_wb / l,
            inverse_r: 1.0 / r,
            inverse_z_square: 1.0 / (r * r),
            rate: r / l,
            short: [false; 2],
        }
    }

    /// Returns the phase resistance, Ω.
    pub(super) fn resistance_ohm(&self) -> f64 {
        self.resistance_ohm
    }

    /// Sets the electrical speed, for stretches of at most `longest_s`.
    pub(super) fn turn_at(&mut self, omega: f64, longest_s: f64) {
        let (r, x) = (self.resistance_ohm, omega * self.inductance_h);
        self.omega = omega;
        self.emf_v = omega * self.flux_wb;
        self.inverse_z_square = 1.0 / (r * r + x * x);
        let share = self.emf_v * self.inverse_z_square;
        self.turning = [-share * x, -share * r];
        self.short = [
            longest_s * self.rate <= DECAY_MAX,
            longest_s * omega.abs() <= ROTATION_MAX,
        ];
    }

    /// Prepares a stretch of at most half a period.
    #[inline(always)] // in each period
    pub(super) fn stretch(&self, time_s: f64) -> Stretch {
        let (angle, fall) = (self.omega * time_s, self.rate * time_s);
        Stretch {
            time_s,
            rotation: if self.short[1] {
                small_rotation(angle)
            } else {
                rotation(angle)
            },
            decay: self.decay(fall),
        }
    }

    /// Returns the remaining share of a transient.
    #[inline(always)] // in each period
    fn decay(&self, fall: f64) -> f64 {
        if self.short[0] {
            small_decay(fall)
        } else {
            libm::exp(-fall)
        }
    }

    /// Returns the closed solution over a stretch.
    #[inline(always)] // in each period
    pub(super) fn solve(&self, now: &Moment, drive: &Drive, stretch: &Stretch) -> Solution {
        let direction = turn(now.direction, stretch.rotation);
        let settled = [drive.u[0] * self.inverse_r, drive.u[1] * self.inverse_r];
        let (from, to) = (back(settled, now.direction), back(settled, direction));
        let transient = [
            now.i[0] - (self.turning[0] + from[0]),
            now.i[1] - (self.turning[1] + from[1]),
        ];
        let left = back(transient, stretch.rotation);
        let i = [
            self.turning[0] + to[0] + left[0] * stretch.decay,
            self.turning[1] + to[1] + left[1] * stretch.decay,
        ];
        let i = match drive.way {
            Way::Star => i,
            way => back(confine(turn(i, direction), way), direction),
        };
        Solution {
            end: Moment { i, direction },
            settled: [from, to],
        }
    }

    /// Advances the currents and the rotor.
    #[inline(always)] // in each period
    pub(super) fn conduct(&self, course: &mut Course, drive: &Drive, stretch: &Stretch) {
        let solution = self.solve(&course.now, drive, stretch);
        self.follow(course, drive, stretch, &solution);
    }

    /// Advances the currents and the rotor to a solution's end, and integrates.
    ///
    /// The integrals of i_q and of the squares use the values and derivatives at both ends (Euler
    /// and Maclaurin's trapezoid): the error is h⁵/720 of the fourth derivative, 1e-6 of the
    /// current if the rotor turns by 0.1. The integral of the current itself, and so charge and
    /// energy, is exact: the flux linkage L·i + φ·e^(jθ) grows by u·h − R·∫i.
    #[inline(always)] // in each period
    pub(super) fn follow(
        &self,
        course: &mut Course,
        drive: &Drive,
        stretch: &Stretch,
        solution: &Solution,
    ) {
        let now = course.now;
        let next = solution.end;
        let [mut from, mut to] = solution.settled;
        course.go(next);
        match drive.way {
            Way::Star => {}
            Way::Without(phase) => {
                from = self.held_open(from, phase, &now);
                to = self.held_open(to, phase, &next);
            }
            Way::Nowhere => return,
        }
        let (from, to) = (self.slope(from, now.i), self.slope(to, next.i));
        let h = stretch.time_s;
        let (half, sixth) = (0.5 * h, h * h * (1.0 / 6.0));
        let ([d0, q0], [d1, q1]) = (now.i, next.i);
        let sums = &mut course.sums;
        sums.q += half * (q0 + q1) + 0.5 * sixth * (from[1] - to[1]);
        sums.squares[0] += half * (d0 * d0 + d1 * d1) + sixth * (d0 * from[0] - d1 * to[0]);
        sums.squares[1] += half * (q0 * q0 + q1 * q1) + sixth * (q0 * from[1] - q1 * to[1]);
        // In the stator's frame.
        let (before, after) = (self.linkage(&now), self.linkage(&next));
        let lost = [
            drive.u[0] * h - (after[0] - before[0]),
            drive.u[1] * h - (after[1] - before[1]),
        ];
        let lost = confine(lost, drive.way);
        sums.energy += dot(drive.u, lost);
        sums.charge += dot(drive.to_bus, lost);
    }

    /// Returns the slope that a voltage along it gives a current, A/s.
    #[inline(always)] // in each period
    pub(super) fn slope_of(&self, volts: f64) -> f64 {
        volts * self.inverse_r * self.rate
    }

    /// Returns the slope of the currents in the stator's frame without voltage, A/s.
    #[inline(always)] // in each period
    pub(super) fn free_slope(&self, now: &Moment) -> [f64; 2] {
        turn(self.slope([0.0; 2], now.i), now.direction)
    }

    /// Returns u/R including the voltage of an open phase along its axis: what the rotor induces.
    fn held_open(&self, settled: [f64; 2], phase: usize, at: &Moment) -> [f64; 2] {
        let axis = back(AXES[phase], at.direction);
        let own = axis[1] * self.emf_v * self.inverse_r - dot(axis, settled);
        [settled[0] + own * axis[0], settled[1] + own * axis[1]]
    }

    /// Returns the derivatives of i_d and i_q: (u − R·i)/L − jω·(i + φ/L).
    #[inline(always)] // in each period
    fn slope(&self, settled: [f64; 2], [d, q]: [f64; 2]) -> [f64; 2] {
        [
            self.rate * (settled[0] - d) + self.omega * q,
            self.rate * (settled[1] - q) - self.omega * (d + self.magnet_a),
        ]
    }

    /// Returns the flux linkage L·i + φ·e^(jθ) in the stator's frame, Vs.
    #[inline(always)] // in each period
    fn linkage(&self, at: &Moment) -> [f64; 2] {
        let l = self.inductance_h;
        turn([l * (at.i[0] + self.magnet_a), l * at.i[1]], at.direction)
    }
}

/// Returns the part of a current vector that can flow.
#[inline(always)] // in each period
pub(super) fn confine(i: [f64; 2], way: Way) -> [f64; 2] {
    match way {
        Way::Star => i,
        Way::Without(phase) => {
            let axis = AXES[phase];
            let own = dot(axis, i);
            [i[0] - own * axis[0], i[1] - own * axis[1]]
        }
        Way::Nowhere => [0.0; 2],
    }
}
