//! Flux and inertia from a turning rotor.

use core::f32::consts::TAU;

use siskin_units::Scale;
use siskin_units::math::{SQRT_3, square_root};

use super::means::{OperatingPoint, seconds};
use super::report::{Figure, Motor, Report};

/// The speed of the runs: over what the supply can reach, and in turns per period.
const RUN_SHARE: f32 = 0.4;
const RUN_TURNS: f32 = 1.0 / 30.0;

/// The share of that speed at which a run down ends.
const SLOW_SHARE: f32 = 0.45;

/// The drive's greatest speed over that of the runs.
const RESERVE: f32 = 1.5;

/// Mean of the back-EMF between two commutations over its peak: 3/π.
const SIX_STEP_SHARE: f32 = 0.955;

/// Greatest deviation of a run's flux from the mean of both.
const FLUX_SPREAD: f32 = 0.1;

/// The measurements of the runs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shaft {
    fast_rad_s: f32,
    /// Of the run up, and of the run down.
    runs: [Run; 2],
}

/// Sums over the polls of a run between the two speeds.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    last: Poll,
    /// ∫i_q dt, and ∫e² dt and ∫ω² dt from products of two polls in succession: their noise does not multiply to
    /// more than zero on average, as the square of one poll's would.
    charge_as: f32,
    emf_square: f32,
    speed_square: f32,
    gained_rad_s: f32,
}

/// What a run has last seen; all zero before its first poll.
#[derive(Clone, Copy, Debug, Default)]
struct Poll {
    us: u64,
    /// Along d and q.
    emf_v: [f32; 2],
    omega_rad_s: f32,
}

impl Run {
    fn add(&mut self, us: u64, point: OperatingPoint, motor: &Motor) {
        let (emf_v, omega_rad_s) = (emf_v(point, motor), point.omega_rad_s);
        let last = &self.last;
        if last.omega_rad_s > 0.0 {
            let passed_s = seconds(us, last.us);
            let [e_d, e_q] = emf_v;
            self.charge_as += point.i_q_a * passed_s;
            self.emf_square += (e_d * last.emf_v[0] + e_q * last.emf_v[1]) * passed_s;
            self.speed_square += omega_rad_s * last.omega_rad_s * passed_s;
            self.gained_rad_s += omega_rad_s - last.omega_rad_s;
        }
        self.last = Poll {
            us,
            emf_v,
            omega_rad_s,
        };
    }
}

/// Returns the voltage along d and q that the current does not account for.
fn emf_v(point: OperatingPoint, motor: &Motor) -> [f32; 2] {
    let reactance_ohm = point.omega_rad_s * motor.l_h;
    [
        point.u_d_v - motor.r_ohm * point.i_d_a + reactance_ohm * point.i_q_a,
        point.u_q_v - motor.r_ohm * point.i_q_a - reactance_ohm * point.i_d_a,
    ]
}

fn length(x: f32, y: f32) -> f32 {
    square_root(x * x + y * y)
}

impl Shaft {
    /// Returns a rough flux, Wb, from what six-step shows. One of its two legs switches: the dead time takes √3/4 of
    /// what it takes along a phase.
    pub(super) fn rough_flux_wb(mean: OperatingPoint, motor: &Motor, dead_v: f32) -> f32 {
        let dropped_v = motor.r_ohm * length(mean.i_d_a, mean.i_q_a) + SQRT_3 / 4.0 * dead_v;
        (length(mean.u_d_v, mean.u_q_v) - dropped_v) / (SIX_STEP_SHARE * mean.omega_rad_s)
    }

    /// Chooses the speed of the runs. Returns the greatest speed to build the drive for, rpm.
    pub(super) fn choose_speed(&mut self, bus_v: f32, motor: &Motor, scale: &Scale) -> f32 {
        let by_supply = RUN_SHARE * bus_v / (SQRT_3 * motor.flux_wb);
        self.fast_rad_s = by_supply.min(RUN_TURNS * TAU / scale.period_s);
        RESERVE * self.fast_rad_s * 60.0 / (TAU * scale.pole_pairs)
    }

    /// Measures during a run up or down. Returns true at its end.
    pub(super) fn measure(
        &mut self,
        now_us: u64,
        point: OperatingPoint,
        down: bool,
        motor: &Motor,
    ) -> bool {
        let slow_rad_s = SLOW_SHARE * self.fast_rad_s;
        let omega_rad_s = point.omega_rad_s;
        if slow_rad_s < omega_rad_s && omega_rad_s < self.fast_rad_s {
            self.runs[usize::from(down)].add(now_us, point, motor);
        }
        if down {
            omega_rad_s <= slow_rad_s
        } else {
            omega_rad_s >= self.fast_rad_s
        }
    }

    /// Computes the runs' figures, or says why there are none.
    pub(super) fn evaluate(
        &self,
        report: &mut Report,
        pole_pairs: f32,
    ) -> Result<(), &'static str> {
        let [up, down] = &self.runs;
        let flux_wb = self
            .runs
            .map(|run| square_root(run.emf_square / run.speed_square));
        report.flux_mwb = Figure::of(&flux_wb, 1e3);
        // J·Δω = k·∫i_q dt − c·∫ω² dt in both runs: two equations for J and c.
        let k = 1.5 * pole_pairs * pole_pairs * 1e-3 * report.flux_mwb.value;
        let j_kgm2 = k * (up.charge_as * down.speed_square - down.charge_as * up.speed_square)
            / (up.gained_rad_s * down.speed_square - down.gained_rad_s * up.speed_square);
        // Where the rotor was lost, a product's sum may be negative, which is no square.
        let are_squares = up.emf_square > 0.0 && down.emf_square > 0.0;
        if are_squares && report.flux_mwb.spread < FLUX_SPREAD && j_kgm2 > 0.0 {
            report.j_gcm2 = Figure::of(&[j_kgm2], 1e7);
            return Ok(());
        }
        Err("Flux differs between the runs")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Noise of the voltages lengthens a vector on average, here by over 3 %.
    #[test]
    fn noise_does_not_add_to_the_flux() {
        const FLUX_WB: f32 = 5e-3;
        let motor = Motor {
            r_ohm: 2.0,
            l_h: 1e-3,
            ..Motor::default()
        };
        // Up to 1.2 V, drawn by a linear congruence.
        let mut draw = 1_u32;
        let mut noise_v = move || {
            draw = draw.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            1.2 * ((draw >> 8) as f32 / (1 << 23) as f32 - 1.0)
        };
        let (mut run, mut length_wb) = (Run::default(), 0.0);
        for poll in 0..1000_u16 {
            let omega_rad_s = 400.0 + 0.4 * f32::from(poll);
            let point = OperatingPoint {
                i_d_a: 0.1,
                i_q_a: 0.5,
                u_d_v: 0.2 - 0.5e-3 * omega_rad_s + noise_v(),
                u_q_v: 1.0 + 0.1e-3 * omega_rad_s + FLUX_WB * omega_rad_s + noise_v(),
                omega_rad_s,
            };
            run.add(1000 * u64::from(poll), point, &motor);
            let [e_d, e_q] = emf_v(point, &motor);
            length_wb += length(e_d, e_q) / omega_rad_s / 1000.0;
        }
        let flux_wb = square_root(run.emf_square / run.speed_square);
        assert!((flux_wb / FLUX_WB - 1.0).abs() < 0.02, "{flux_wb}");
        assert!(length_wb / FLUX_WB > 1.03, "{length_wb}");
        assert!((run.gained_rad_s / 399.6 - 1.0).abs() < 1e-4);
        assert!((run.charge_as / 0.4995 - 1.0).abs() < 1e-3);
    }
}
