//! One drive on its bench: the control's step against the plant, period by period.

use std::f64::consts::TAU;

use siskin_control::control::delay::Delay;
use siskin_control::drive::{self, Bridge, Config, Sample, Setpoint, Snapshot, State};

use crate::bench::{LOADS, MOTORS};
use crate::plant::{Fidelity, Flow, Load, Motor, Noise, Plant, Sensing, Supply, Thermal, Truth};

/// What stands on the bench.
#[derive(Clone, Debug, PartialEq)]
pub struct Bench {
    /// The motor.
    pub motor: Motor,
    /// What it turns.
    pub load: Load,
    /// What feeds it.
    pub supply: Supply,
    /// How the inverter is simulated.
    pub plant: Fidelity,
    /// Sensors and converter.
    pub sensing: Sensing,
    /// What a broken Hall sensor shows.
    pub hall_stuck: [Option<bool>; 3],
    /// Control periods from the sample to the voltage.
    pub delay: Delay,
    /// Dead time of the inverter, s; `None` is what the parameters set the timer to.
    pub dead_time_s: Option<f64>,
    /// Speed that the shaft is held at, rad/s.
    pub imposed_rad_s: Option<f64>,
    /// Speed at the start, rad/s.
    pub initial_rad_s: f64,
    /// Electrical angle at the start, turns.
    pub initial_angle_turns: f64,
    /// Seed of all randomness.
    pub seed: u64,
}

impl Default for Bench {
    /// The bench of the first paper's section V with the sensors of a board: an Antigravity 4006
    /// KV380 with a 13×4.4 propeller at 24 V; 12 bits over ±40 A, 0.05 A of noise, one period of
    /// delay and the dead time of the parameters.
    fn default() -> Self {
        Self {
            motor: MOTORS[0].1,
            load: LOADS[0].1,
            supply: Supply::stiff(24.0),
            plant: Fidelity::Averaged,
            sensing: Sensing::default(),
            hall_stuck: [None; 3],
            delay: Delay::One,
            dead_time_s: None,
            imposed_rad_s: None,
            initial_rad_s: 0.0,
            initial_angle_turns: 0.0,
            seed: 1,
        }
    }
}

/// The truth at a sample, and what flowed until the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// What the converter read.
    pub sample: Sample,
    /// What the drive was asked for.
    pub setpoint: Setpoint,
    /// What the bridge was told.
    pub bridge: Bridge,
    /// Electrical angle, turns, 0..1.
    pub angle_turns: f64,
    /// Mechanical speed, rad/s.
    pub speed_rad_s: f64,
    /// Currents into the phases, A.
    pub currents_a: [f64; 3],
    /// Supply voltage, V.
    pub bus_v: f64,
    /// Current from the supply, A.
    pub bus_a: f64,
    /// Means over the period.
    pub flow: Flow,
}

/// A drive on its bench.
#[derive(Clone, Debug)]
pub struct Rig {
    bench: Bench,
    config: Config,
    state: State,
    plant: Plant,
    thermal: Thermal,
    noise: Noise,
    /// What the bridge does until the latest command takes effect.
    applied: Bridge,
    bus_v: f64,
}

impl Rig {
    /// The bench at its start, with the control at power-up.
    pub fn new(bench: Bench, config: Config) -> Self {
        let mut plant = Plant::new(
            bench.plant,
            bench.motor,
            bench.load,
            bench.initial_rad_s,
            bench.initial_angle_turns,
        );
        if let Some(speed_rad_s) = bench.imposed_rad_s {
            plant.impose(speed_rad_s);
        }
        Self {
            state: State::new(&config),
            plant,
            thermal: Thermal::new(),
            noise: Noise::new(bench.seed),
            applied: Bridge::Off,
            bus_v: bench.supply.voltage(0.0),
            bench,
            config,
        }
    }

    /// Swaps the control's configuration, as the tasks do between two periods.
    ///
    /// The period's length stays that of the start.
    pub fn configure(&mut self, config: Config) {
        self.state.adopt(&self.config, &config);
        self.config = config;
    }

    /// Starts the control anew, as after a reset of the chip; the plant goes on.
    pub fn restart(&mut self, config: Config) {
        self.state = State::new(&config);
        self.config = config;
        self.applied = Bridge::Off;
    }

    /// Breaks a phase's Hall sensor, so that it shows one level, or mends it.
    pub fn stick_hall(&mut self, phase: usize, level: Option<bool>) {
        if let Some(stuck) = self.bench.hall_stuck.get_mut(phase) {
            *stuck = level;
        }
    }

    /// The control's configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What the tasks may know of the control.
    pub fn snapshot(&self) -> Snapshot {
        self.state.snapshot()
    }

    /// Every word of the control state.
    #[inline(always)]
    pub fn trace(&self, out: &mut impl FnMut(u32)) {
        self.state.trace(&self.config, out);
    }

    /// Temperature of the board, °C.
    pub fn temperature_c(&self) -> f64 {
        self.thermal.temperature_c
    }

    /// Length of a control period, s.
    pub fn period_s(&self) -> f64 {
        f64::from(self.config.scale.period_s)
    }

    /// The next control period.
    pub fn period(&mut self, setpoint: Setpoint) -> Period {
        let currents_a = self.plant.currents_a();
        let (angle_turns, speed_rad_s) = (self.plant.angle_turns(), self.plant.speed_rad_s());
        let truth = Truth {
            currents_a,
            low_s: self.plant.low_s(),
            terminals_v: self.plant.terminals_v(),
            bus_v: self.bus_v,
            direction: self.plant.direction(),
        };
        let mut sample = self.bench.sensing.sample(&truth, &mut self.noise);
        for (phase, stuck) in self.bench.hall_stuck.into_iter().enumerate() {
            if let Some(level) = stuck {
                sample.hall = sample.hall & !(1 << phase) | u8::from(level) << phase;
            }
        }
        let bridge = drive::step(&self.config, &mut self.state, sample, setpoint);

        // Turning off does not wait for the timer's preload.
        let before = if bridge == Bridge::Off {
            bridge
        } else {
            self.applied
        };
        let halves = match self.bench.delay {
            Delay::None => [bridge, bridge],
            Delay::Half => [before, bridge],
            Delay::One => [before, before],
        };
        self.applied = bridge;
        let period_s = self.period_s();
        let dead_time_s = self.bench.dead_time_s.unwrap_or_else(|| {
            let share: f64 = self.config.dead_time.duty.to_num();
            share * period_s
        });
        let flow = self.plant.period(halves, self.bus_v, period_s, dead_time_s);
        let bus_v = self.bus_v;
        self.bus_v = self.bench.supply.voltage(flow.bus_a);
        let current_square = flow.copper_w / (1.5 * self.bench.motor.resistance_ohm);
        self.thermal.advance(period_s, current_square.sqrt());
        Period {
            sample,
            setpoint,
            bridge,
            angle_turns,
            speed_rad_s,
            currents_a,
            bus_v,
            bus_a: flow.bus_a,
            flow,
        }
    }
}

impl Period {
    /// Whether the plant's numbers have become none.
    pub fn diverged(&self) -> bool {
        !(self.speed_rad_s.is_finite() && self.flow.torque_nm.is_finite())
    }

    /// Estimated less true electrical angle at the sample, degrees, ±180.
    pub fn angle_error_deg(&self, snapshot: &Snapshot) -> f64 {
        let turns = snapshot.angle.to_num::<f64>() - self.angle_turns;
        (turns - libm::round(turns)) * 360.0
    }

    /// Mechanical speed, rpm.
    pub fn rpm(&self) -> f64 {
        self.speed_rad_s * 60.0 / TAU
    }
}
