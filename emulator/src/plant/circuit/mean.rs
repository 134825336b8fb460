//! A mean voltage over a whole period.

use super::super::series::small_sinc;
use super::super::vector::{back, dot, turn};
use super::{Circuit, Course, Drive, Way};

impl Circuit {
    /// Like [`Self::conduct`] over up to a period, for a mean voltage; a supply of `bus_v` provides the power that goes
    /// into the motor.
    ///
    /// The means of i_d and i_q are exact, by their equation's: (R + jωL) times the mean is the mean of the voltage,
    /// which turns against the rotor, less the growth of the flux linkage. For their squares the variance is a
    /// parabola's.
    #[inline(always)] // in each period
    pub(in super::super) fn conduct_mean(
        &self,
        course: &mut Course,
        u: [f64; 2],
        bus_v: f64,
        time_s: f64,
    ) {
        let drive = Drive {
            u,
            to_bus: [0.0; 2],
            way: Way::Star,
        };
        let (h, now) = (time_s, course.now);
        let half = self.stretch(0.5 * h);
        let solution = self.solve(&now, &drive, &half.twice());
        let next = solution.end;
        course.now = next;

        let angle = self.omega * half.time_s;
        let sinc = if self.short[1] {
            small_sinc(angle)
        } else {
            half.rotation[1] / angle
        };
        let [u_d, u_q] = back(u, turn(now.direction, half.rotation));
        let (r, l) = (self.resistance_ohm, self.inductance_h);
        let grown = [next.i[0] - now.i[0], next.i[1] - now.i[1]];
        let left = [
            h * sinc * u_d - l * grown[0],
            h * (sinc * u_q - self.emf_v) - l * grown[1],
        ];
        let x = self.omega * l;
        let flowed = [
            (r * left[0] + x * left[1]) * self.inverse_z_square,
            (r * left[1] - x * left[0]) * self.inverse_z_square,
        ];
        let per_s = 1.0 / h;
        let square = |k: usize| {
            let mean = flowed[k] * per_s;
            let bulge = mean - 0.5 * (now.i[k] + next.i[k]);
            h * (mean * mean + grown[k] * grown[k] * (1.0 / 12.0) + 0.2 * bulge * bulge)
        };
        let sums = &mut course.sums;
        sums.q += flowed[1];
        sums.squares[0] += square(0);
        sums.squares[1] += square(1);
        // u·(u·h − the growth of L·i + φ·e^(jθ)), in the rotor's frame at either end.
        let [from, to] = solution.settled;
        let m = self.magnet_a;
        let along = |settled: [f64; 2], [d, q]: [f64; 2]| dot(settled, [d + m, q]);
        let linked = r * l * (along(to, next.i) - along(from, now.i));
        let energy = dot(u, u) * h - linked;
        sums.energy += energy;
        sums.charge += 1.5 * energy / bus_v.max(1.0);
    }
}
