//! The contents of a bench.

use siskin_control::drive::Config;
use siskin_params::{Delay, parts};

use super::choice::Choice;
use super::load::LoadTable;
use super::motor::MotorTable;
use crate::plant::{BOARD_K_PER_W, Extras, Fidelity, Load, Motor, Sensing, Supply};

/// The motor of the default bench.
pub const DEFAULT_MOTOR: &str = "antigravity-4006-kv380";

/// The load of the default bench.
pub const DEFAULT_LOAD: &str = "cfprop-13x4.4";

/// Where the control gets the rotor's position.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Position {
    /// Its own observer.
    #[default]
    Observer,
    /// The truth: angle and speed at each sample.
    Ideal,
}

/// The contents of a bench.
#[derive(Clone, Debug, PartialEq)]
pub struct Bench {
    /// The motor.
    pub motor: Motor,
    /// Its deviations from the ideal motor.
    pub extras: Extras,
    /// What it drives.
    pub load: Load,
    /// What feeds it.
    pub supply: Supply,
    /// How the inverter is simulated.
    pub plant: Fidelity,
    /// Where the control gets the rotor's position.
    pub position: Position,
    /// Sensors and converter.
    pub sensing: Sensing,
    /// Control periods from the sample to the voltage.
    pub delay: Delay,
    /// Dead time of the inverter, s; `None` for the timer's, as set by the parameters.
    pub dead_time_s: Option<f64>,
    /// Thermal resistance from the board to the air, K/W.
    pub board_k_per_w: f64,
    /// Speed at which the shaft is held, rad/s.
    pub imposed_rad_s: Option<f64>,
    /// Speed at the start, rad/s.
    pub initial_rad_s: f64,
    /// Electrical angle at the start, turns.
    pub initial_angle_turns: f64,
    /// Seed of all randomness.
    pub seed: u64,
}

impl Default for Bench {
    /// Creates the bench of the first paper's section V with the sensors of a board: an Antigravity
    /// 4006 KV380 with a 13×4.4 propeller at 24 V; 12 bits over ±40 A, 0.05 A of noise, one period
    /// of delay and the dead time of the parameters.
    fn default() -> Self {
        let built_in = "the built-in benches are tested";
        let motor = Choice::<MotorTable>::Named(DEFAULT_MOTOR.to_owned());
        let load = Choice::<LoadTable>::Named(DEFAULT_LOAD.to_owned());
        let (motor, extras) = motor.motor().expect(built_in);
        Self {
            motor,
            extras,
            load: load.load().expect(built_in),
            supply: Supply::stiff(24.0),
            plant: Fidelity::Averaged,
            position: Position::Observer,
            sensing: Sensing::default(),
            delay: Delay::One,
            dead_time_s: None,
            board_k_per_w: BOARD_K_PER_W,
            imposed_rad_s: None,
            initial_rad_s: 0.0,
            initial_angle_turns: 0.0,
            seed: 1,
        }
    }
}

impl Bench {
    /// Returns the control's configuration with this bench's source of the rotor's position.
    pub(crate) fn observed(&self, config: Config) -> Config {
        match self.position {
            Position::Observer => config,
            Position::Ideal => config.with_position_given(parts::Bench::HERE),
        }
    }
}
