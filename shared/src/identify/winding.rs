//! R and L from the means of the excitations.

use siskin_units::Scale;

use super::means::OperatingPoint;
use super::report::{Figure, Motor, Report};

/// Greatest deviation of a phase's R from the mean, and of L likewise: a salient rotor's axes differ.
const R_SPREAD: f32 = 0.1;
const L_SPREAD: f32 = 0.5;

/// A phase's excitations in order: two currents, then a square wave along the current and one across it.
pub(super) const LOWER: u8 = 0;
const UPPER: u8 = 1;
const ALONG: u8 = 2;

/// The measurements from the excitations of the three phases.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Winding {
    /// Current and voltage at the lower of two currents.
    lower_a: f32,
    lower_v: f32,
    r_ohm: [f32; 3],
    dead_v: [f32; 3],
    /// L along each phase's axis and across it.
    l_h: [[f32; 3]; 2],
}

impl Winding {
    /// Takes the mean over one of a phase's excitations, by its number from [`LOWER`] on.
    pub(super) fn take(
        &mut self,
        phase: usize,
        excitation: u8,
        mean: OperatingPoint,
        period_s: f32,
    ) {
        let (i_a, u_v) = (mean.i_d_a, mean.u_d_v);
        match excitation {
            LOWER => (self.lower_a, self.lower_v) = (i_a, u_v),
            UPPER => {
                let r_ohm = (u_v - self.lower_v) / (i_a - self.lower_a);
                self.r_ohm[phase] = r_ohm;
                self.dead_v[phase] = u_v - r_ohm * i_a;
            }
            _ => {
                let axis = usize::from(excitation - ALONG);
                self.l_h[axis][phase] =
                    inductance(self.r_ohm[phase], period_s, mean.u_q_v, mean.i_q_a);
            }
        }
    }

    /// Returns the voltage that the dead time takes along a phase's axis, V.
    pub(super) fn dead_v(&self) -> f32 {
        Figure::of(&self.dead_v, 1.0).value
    }

    /// Computes the winding's figures, or says why there are none.
    pub(super) fn evaluate(
        &self,
        report: &mut Report,
        motor: &mut Motor,
        (scale, bus_v): (&Scale, f32),
    ) -> Result<(), &'static str> {
        report.r_mohm = Figure::of(&self.r_ohm, 1e3);
        report.l_uh = Figure::of(self.l_h.as_flattened(), 1e6);
        report.l_axes_uh = self.l_h.map(|l_h| Figure::of(&l_h, 1e6));
        // Along a phase's axis the dead time takes 4/3 of what it takes from a phase.
        report.dead_time_ns = Figure::of(&self.dead_v, 0.75e9 * scale.period_s / bus_v);
        motor.r_ohm = 1e-3 * report.r_mohm.value;
        motor.l_h = 1e-6 * report.l_uh.value;
        // The comparisons also reject NaN.
        if motor.r_ohm > 0.0 && report.r_mohm.spread < R_SPREAD {
            if motor.l_h > 0.0 && report.l_uh.spread < L_SPREAD {
                return Ok(());
            }
            return Err("L differs between phases");
        }
        Err("R differs between phases")
    }
}

/// Returns L from the current that a square wave of voltage, two periods up and two down, has driven. Within two
/// periods the current goes from one peak to the other: i = u/R·tanh(R·T_s/L).
fn inductance(r_ohm: f32, period_s: f32, u_v: f32, i_a: f32) -> f32 {
    let z = r_ohm * i_a / u_v;
    let square = z * z;
    // z/artanh(z), accurate to 1 % up to 0.7.
    let ratio = 1.0 - square * (1.0 / 3.0 + square * (4.0 / 45.0 + square * (44.0 / 945.0)));
    period_s * u_v / i_a * ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Simulates a winding's current, period by period.
    #[test]
    fn an_inductance_is_found_whatever_the_resistance() {
        let (period_s, u_v) = (1.0 / 24_000.0, 0.5);
        for l_h in [3e-6_f32, 30e-6, 2e-3] {
            for time_s in [0.1e-3_f32, 0.3e-3, 1e-3] {
                let r_ohm = l_h / time_s;
                let kept = (-period_s / time_s).exp();
                let mut i_a = 0.0;
                let peaks: Vec<f32> = (0..4000)
                    .map(|period| {
                        let u_v = if period % 4 < 2 { u_v } else { -u_v };
                        i_a = kept * i_a + (1.0 - kept) * u_v / r_ohm;
                        i_a
                    })
                    .collect();
                // The last is the end of the second period down.
                let found = inductance(r_ohm, period_s, u_v, -peaks[3999]);
                assert!((found / l_h - 1.0).abs() < 0.01, "{l_h} {time_s}: {found}");
            }
        }
    }
}
