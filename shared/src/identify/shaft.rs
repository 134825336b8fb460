//! Flux and inertia from a turning rotor.

use core::f32::consts::TAU;

use super::means::{OperatingPoint, seconds};
use super::report::{Figure, Motor, Report};
use crate::math::{SQRT_3, square_root};
use crate::units::Scale;

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
    polls: f32,
    flux_wb: f32,
    /// ∫i_q dt and ∫ω² dt.
    charge_as: f32,
    square: f32,
    first_rad_s: f32,
    gained_rad_s: f32,
    last_us: u64,
}

impl Run {
    fn add(&mut self, now_us: u64, point: OperatingPoint, motor: &Motor) {
        let omega_rad_s = point.omega_rad_s;
        if self.polls == 0.0 {
            self.first_rad_s = omega_rad_s;
        } else {
            let passed_s = seconds(now_us, self.last_us);
            self.charge_as += point.i_q_a * passed_s;
            self.square += omega_rad_s * omega_rad_s * passed_s;
        }
        self.last_us = now_us;
        self.gained_rad_s = omega_rad_s - self.first_rad_s;
        self.polls += 1.0;
        self.flux_wb += emf_v(point, motor) / omega_rad_s;
    }
}

/// Returns the magnitude of the voltage that the current does not account for, whatever the angle of the frame.
fn emf_v(point: OperatingPoint, motor: &Motor) -> f32 {
    let reactance_ohm = point.omega_rad_s * motor.l_h;
    let e_d_v = point.u_d_v - motor.r_ohm * point.i_d_a + reactance_ohm * point.i_q_a;
    let e_q_v = point.u_q_v - motor.r_ohm * point.i_q_a - reactance_ohm * point.i_d_a;
    length(e_d_v, e_q_v)
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
        let flux_wb = self.runs.map(|run| run.flux_wb / run.polls);
        report.flux_mwb = Figure::of(&flux_wb, 1e3);
        // J·Δω = k·∫i_q dt − c·∫ω² dt in both runs: two equations for J and c.
        let k = 1.5 * pole_pairs * pole_pairs * 1e-3 * report.flux_mwb.value;
        let j_kgm2 = k * (up.charge_as * down.square - down.charge_as * up.square)
            / (up.gained_rad_s * down.square - down.gained_rad_s * up.square);
        if report.flux_mwb.spread < FLUX_SPREAD && j_kgm2 > 0.0 {
            report.j_gcm2 = Figure::of(&[j_kgm2], 1e7);
            return Ok(());
        }
        Err("Flux differs between the runs")
    }
}
