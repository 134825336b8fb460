//! A motor at constant speed, advanced by the legs' states from edge to edge.

use std::f64::consts::TAU;

use super::means::Means;
use super::setting::{BUS_V, MOTOR};
use crate::plant::{Fidelity, Load, Plant, Rail};

/// Longest piece of a waveform, s: 1/67 of a PWM period.
const PIECE_S: f64 = 1e-6;

/// The switch that is on for each leg, or none.
pub(super) type Legs = [Option<Rail>; 3];

/// The motor, its measurements, and its torque's waveform if wanted.
pub(super) struct Course {
    plant: Plant,
    /// The measurements since [`Course::measure`].
    pub(super) means: Means,
    /// Torque at the middle of each piece of the last part: s since its start, and Nm.
    pub(super) waveform: Vec<(f64, f64)>,
    since_s: f64,
    draws: bool,
}

impl Course {
    /// Creates the paper's motor held at a speed, from an electrical angle.
    pub(super) fn new(rpm: f64, angle_turns: f64) -> Self {
        let mut plant = Plant::new(
            Fidelity::Switching,
            *MOTOR,
            Load::default(),
            0.0,
            angle_turns,
        );
        plant.impose(rpm * TAU / 60.0);
        Self {
            plant,
            means: Means::default(),
            waveform: Vec::new(),
            since_s: 0.0,
            draws: false,
        }
    }

    /// Starts measuring; discards what was before.
    pub(super) fn measure(&mut self) {
        self.means = Means::default();
    }

    /// Starts drawing.
    pub(super) fn draw(&mut self) {
        (self.draws, self.since_s) = (true, 0.0);
    }

    /// Runs with these leg states for a time.
    pub(super) fn run(&mut self, legs: Legs, time_s: f64) {
        if time_s <= 0.0 {
            return;
        }
        let pieces = if self.draws {
            libm::ceil(time_s / PIECE_S)
        } else {
            1.0
        };
        let piece_s = time_s / pieces;
        for _ in 0..pieces as u32 {
            let flow = self.plant.legs(legs, BUS_V, piece_s);
            self.means.add(&flow, piece_s);
            if self.draws {
                let middle_s = self.since_s + 0.5 * piece_s;
                self.waveform.push((middle_s, flow.torque_nm));
                self.since_s += piece_s;
            }
        }
    }
}
