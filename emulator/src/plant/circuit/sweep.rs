//! Half a period of drive: three legs step from one rail to the other, one after the other.
//!
//! In the stator's frame the voltage is constant between two steps, and so, but for its decay, is what the currents are
//! apart from u/R and from what the rotor induces. So the currents at all steps follow at once, and the four stretches
//! between them are computed side by side.
//!
//! In a dead time the diode of one of the rails carries the current, and only its voltage is special. The circuit is
//! linear: its effect on the currents is added to the solution without it, at the dead time's end or start, as a kick.

use std::array;

use wide::f64x4;

use super::super::series::{rotation, small_decay, small_rotation};
use super::super::vector::{AXES, ROOT_3, back, turn};
use super::{Circuit, Course, Moment};

/// Allowed deviation of a current's change in a dead time from a straight line, relative to the change: R/L and ω times
/// a dead time are some 0.01.
const BEND: f64 = 0.05;

/// What the legs do.
pub(in super::super) struct Sweep {
    /// The legs in order of time.
    pub(in super::super) order: [usize; 3],
    /// When each leg's voltage changes, s.
    pub(in super::super) at_s: [f64; 3],
    /// Whether that is at the end of its dead time, because its current's diode is at the rail that it leaves; else it
    /// is at the start.
    pub(in super::super) stays: [bool; 3],
    /// Whether they go from the negative pole to the positive one, or back.
    pub(in super::super) rises: bool,
    /// The length of the voltage vector with one or two legs high, V.
    pub(in super::super) volts: f64,
    /// The part of it that is a diode's own.
    pub(in super::super) diode_v: f64,
    pub(in super::super) dead_s: f64,
    /// Whether dead times overlap.
    pub(in super::super) overlaps: bool,
    /// Its length, s: half a period.
    pub(in super::super) time_s: f64,
}

/// A vector in each stretch, or at each stretch's start or end.
#[derive(Clone, Copy)]
struct Vectors {
    x: f64x4,
    y: f64x4,
}

impl Vectors {
    #[inline(always)] // in each period
    fn from(of: impl Fn(usize) -> [f64; 2]) -> Self {
        Self {
            x: f64x4::from(array::from_fn(|k| of(k)[0])),
            y: f64x4::from(array::from_fn(|k| of(k)[1])),
        }
    }

    #[inline(always)] // in each period
    fn plus(self, other: Self) -> Self {
        Self {
            x: self.x + other.x,
            y: self.y + other.y,
        }
    }

    #[inline(always)] // in each period
    fn less(self, other: Self) -> Self {
        Self {
            x: self.x - other.x,
            y: self.y - other.y,
        }
    }

    #[inline(always)] // in each period
    fn times(self, factor: f64) -> Self {
        Self {
            x: self.x * factor,
            y: self.y * factor,
        }
    }

    /// Multiplies each by a vector, as complex numbers.
    #[inline(always)] // in each period
    fn turned(self, [cos, sin]: [f64; 2]) -> Self {
        Self {
            x: self.x * cos - self.y * sin,
            y: self.y * cos + self.x * sin,
        }
    }

    #[inline(always)] // in each period
    fn dot(self, other: Self) -> f64x4 {
        self.x * other.x + self.y * other.y
    }

    #[inline(always)] // in each period
    fn cross(self, other: Self) -> f64x4 {
        self.x * other.y - self.y * other.x
    }

    /// Returns those at the stretches' starts, from those at their ends and the first.
    #[inline(always)] // in each period
    fn before(self, first: [f64; 2]) -> Self {
        let ([a, b, c, _], [d, e, f, _]) = (self.x.to_array(), self.y.to_array());
        Self {
            x: f64x4::from([first[0], a, b, c]),
            y: f64x4::from([first[1], d, e, f]),
        }
    }

    #[inline(always)] // in each period
    fn last(self) -> [f64; 2] {
        [self.x.to_array()[3], self.y.to_array()[3]]
    }
}

/// Sums in this order on every machine.
#[inline(always)] // in each period
fn sum(parts: f64x4) -> f64 {
    let [a, b, c, d] = parts.to_array();
    (a + b) + (c + d)
}

impl Circuit {
    /// Advances the currents and the rotor through a sweep, and integrates. Returns false, having done nothing, if a
    /// current comes too close to zero in its dead time for its diode to be certain.
    ///
    /// In each stretch i_q is taken as a parabola through its values and derivatives at both ends: the mean is accurate
    /// to fourth order, and the mean of the square is the mean's square plus the variance. The current's square is by
    /// the trapezoid, and the charge exact, as in [`Circuit::follow`].
    #[inline(always)] // in each period
    pub(in super::super) fn sweep(&self, course: &mut Course, sweep: &Sweep) -> bool {
        let Sweep { volts, dead_s, .. } = *sweep;
        let [a, b, c] = sweep.order;
        let (r, l, rate, omega) = (
            self.resistance_ohm,
            self.inductance_h,
            self.rate,
            self.omega,
        );
        let induced = omega * self.magnet_a;
        let step = if sweep.rises { 1.0 } else { -1.0 };
        let settled_a = volts * self.inverse_r;
        let axes = [AXES[a], AXES[b], AXES[c], [0.0; 2]];
        let stays = [sweep.stays[a], sweep.stays[b], sweep.stays[c]];
        let at_s = [sweep.at_s[a], sweep.at_s[b], sweep.at_s[c]];
        // Sum of the axes of the legs that are high; two of them sum to the length of one, and three to zero.
        let high = [
            [0.0; 2],
            axes[0].map(|x| step * x),
            axes[2].map(|x| -step * x),
            [0.0; 2],
        ];
        let high = Vectors::from(|k| high[k]);
        let length = f64x4::from([0.0, 1.0, 1.0, 0.0]);
        let settled = high.times(settled_a);

        // What each leg's diode adds, and on which side in time its dead time lies.
        let [last_a, first_a] = self.kick_a(sweep.diode_v, dead_s);
        let either = |stayed: f64, moved: f64| {
            let [a, b, c] = stays.map(|stays| if stays { stayed } else { moved });
            f64x4::from([a, b, c, 0.0])
        };
        let kick_a = either(-step * last_a, step * first_a);
        let dead = either(-dead_s, dead_s);
        let sign = either(step, -step);
        // Whether the kick is already in the current at its step.
        let own = either(0.0, 1.0);
        // The voltage along the leg's own axis in its dead time, over `volts`.
        let during = (f64x4::from([0.0, -0.5, -1.0, 0.0]) + own) * step;

        // The rotor at the stretches' ends and starts, and the currents that turn with it.
        let end_s = f64x4::from([at_s[0], at_s[1], at_s[2], sweep.time_s]);
        let h = end_s - f64x4::from([0.0, at_s[0], at_s[1], at_s[2]]);
        let now = course.now;
        let to = self.rotations(end_s).turned(now.direction);
        let from = to.before(now.direction);
        let turning = to.turned(self.turning);
        // The remaining transient, and what the steps add to it.
        let decay = self.decays(h).to_array();
        let jump_a = (kick_a - step * settled_a).to_array();
        let start_a = now.stator_a();
        let at_rest = turn(self.turning, now.direction);
        let mut rest = [start_a[0] - at_rest[0], start_a[1] - at_rest[1]];
        let mut left = [[0.0; 2]; 4];
        for k in 0..4 {
            left[k] = rest.map(|x| x * decay[k]);
            rest = [0, 1].map(|xy| left[k][xy] + jump_a[k] * axes[k][xy]);
        }
        let axes = Vectors::from(|k| axes[k]);
        let end = settled.plus(turning).plus(Vectors::from(|k| left[k]));

        let along = axes.dot(end);
        let across = to.cross(axes);
        let slope = (during * settled_a - along) * rate - across * induced;
        let change = dead * slope;
        let least = (sign * along).min(sign * (along + change));
        let turned = omega * dead_s;
        let beside_a = if sweep.overlaps {
            settled_a * rate * dead_s
        } else {
            0.0
        };
        let margin_a = 2.0 * first_a + turned * turned * self.magnet_a + beside_a;
        let [least_a, least_b, least_c, _] = (least - change.abs() * BEND).to_array();
        if least_a.min(least_b).min(least_c) <= margin_a {
            return false;
        }

        let kicks = Vectors {
            x: axes.x * kick_a,
            y: axes.y * kick_a,
        };
        let start = end.plus(kicks).before(start_a);
        let (moved, swung) = (end.less(start), to.less(from));
        let (q0, q1) = (from.cross(start), to.cross(end));
        let (square0, square1) = (start.dot(start), end.dot(end));
        let grown = q1 - q0;
        // Fall of the derivatives from end to end.
        let fall_q =
            (grown - swung.cross(settled)) * rate + (to.dot(end) - from.dot(start)) * omega;
        let fall_square = (square1 - square0 - moved.dot(settled)) * rate + grown * induced;
        let bulge = h * fall_q * (1.0 / 12.0);
        let mean = (q0 + q1) * 0.5 + bulge;
        let variance = grown * grown * (1.0 / 12.0) + bulge * bulge * 0.2;
        let q = h * mean;
        let q_square = h * (mean * mean + variance);
        let square = h * ((square0 + square1) * 0.5 + h * fall_square * (1.0 / 6.0));
        let linked = moved.times(l).plus(swung.times(self.flux_wb));
        let charge = h * length * volts - high.dot(linked);

        // What of a kick's integrals is missing or too much: it grew linearly before its step, or is yet to grow after
        // it.
        let kick_q = kick_a * across;
        let missing = dead * kick_a * -0.5;
        let missing_q = missing * across;
        let missing_square = missing * (along + own * kick_a) * 2.0;
        let missing_q_square = missing_q * (q1 + own * kick_q) * 2.0;
        // What it stores in the inductance, and what shaft and copper take meanwhile.
        let stored = kick_a * (along + kick_a * 0.5) * l;
        let spent = missing_q * self.emf_v + missing_square * r;

        let sums = &mut course.sums;
        let q_square = sum(q_square + missing_q_square);
        sums.q += sum(q + missing_q);
        sums.squares[0] += sum(square + missing_square) - q_square;
        sums.squares[1] += q_square;
        sums.energy += sum(charge * volts + (stored + spent) * r);
        sums.charge += sum(charge + missing * during * r);
        // The largest phase current of each vector, as in `largest`.
        let (x, y) = (end.x.abs(), end.y.abs());
        let largest = x.fast_max((x + y * ROOT_3) * 0.5).to_array();
        for current_a in largest {
            course.reach(current_a);
        }
        let direction = to.last();
        course.now = Moment {
            i: back(end.last(), direction),
            direction,
        };
        true
    }

    /// Returns cosines and sines of the rotor's angle over times of at most half a period.
    #[inline(always)] // in each period
    fn rotations(&self, times_s: f64x4) -> Vectors {
        let angles = times_s * self.omega;
        if self.short[1] {
            let [x, y] = small_rotation(angles);
            Vectors { x, y }
        } else {
            let rotations = angles.to_array().map(rotation);
            Vectors::from(|k| rotations[k])
        }
    }

    /// Returns the remaining share of a transient after times of at most half a period.
    #[inline(always)] // in each period
    fn decays(&self, times_s: f64x4) -> f64x4 {
        let falls = times_s * self.rate;
        if self.short[0] {
            small_decay(falls)
        } else {
            f64x4::from(falls.to_array().map(|fall| libm::exp(-fall)))
        }
    }

    /// Returns the effect of a short voltage pulse on a current along it, A: at the pulse's end, and what would have to
    /// be there at its start to decay to that.
    fn kick_a(&self, voltage_v: f64, time_s: f64) -> [f64; 2] {
        let decay = self.decay(self.rate * time_s);
        let last_a = voltage_v * self.inverse_r * (1.0 - decay);
        [last_a, last_a / decay]
    }
}
