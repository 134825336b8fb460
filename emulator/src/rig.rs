//! One drive on its bench: the control's step against the plant, period by period.

use std::f64::consts::TAU;

use siskin_control::control::delay::Delay;
use siskin_control::drive::{self, Bridge, Config, Fault, Sample, Setpoint, Snapshot, State};
use siskin_control::units::{Angle, Speed};

use crate::bench::{Choice, DEFAULT_LOAD, DEFAULT_MOTOR, LoadTable, MotorTable};
use crate::fault::InForce;
use crate::plant::{
    Bus, Extras, Fidelity, Flow, Load, Motor, Noise, Plant, Sensing, Supply, Thermal, Truth,
};

/// Where the control has the rotor's position from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Position {
    /// Its own observer.
    #[default]
    Observer,
    /// The truth: angle and speed at each sample.
    Ideal,
}

/// What stands on the bench.
#[derive(Clone, Debug, PartialEq)]
pub struct Bench {
    /// The motor.
    pub motor: Motor,
    /// What it has beyond the ideal motor.
    pub extras: Extras,
    /// What it turns.
    pub load: Load,
    /// What feeds it.
    pub supply: Supply,
    /// How the inverter is simulated.
    pub plant: Fidelity,
    /// Where the control has the rotor's position from.
    pub position: Position,
    /// Sensors and converter.
    pub sensing: Sensing,
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
    /// What the bridge did in each half, after the delay.
    pub halves: [Bridge; 2],
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
    bus: Bus,
    /// The sensors as they are now.
    sensing: Sensing,
    /// What stuck current sensors show, A.
    stuck_a: [Option<f64>; 3],
    /// What stuck Hall sensors show.
    hall_stuck: [Option<bool>; 3],
    /// Whether the chip is in reset.
    held: bool,
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
        plant.fit(&bench.extras);
        if let Some(speed_rad_s) = bench.imposed_rad_s {
            plant.impose(speed_rad_s);
        }
        let config = bench.observed(config);
        Self {
            state: State::new(&config),
            plant,
            thermal: Thermal::new(),
            noise: Noise::new(bench.seed),
            applied: Bridge::Off,
            bus: Bus::new(bench.supply),
            sensing: bench.sensing,
            stuck_a: [None; 3],
            hall_stuck: [None; 3],
            held: false,
            bench,
            config,
        }
    }

    /// Swaps the control's configuration, as the tasks do between two periods.
    ///
    /// The period's length stays that of the start.
    pub fn configure(&mut self, config: Config) {
        let config = self.bench.observed(config);
        self.state.adopt(&self.config, &config);
        self.config = config;
    }

    /// Starts the control anew, as after a reset of the chip; the plant goes on.
    pub fn restart(&mut self, config: Config) {
        let config = self.bench.observed(config);
        self.state = State::new(&config);
        self.config = config;
        self.applied = Bridge::Off;
    }

    /// Lets other faults act than before.
    pub fn disturb(&mut self, before: &InForce, now: &InForce) {
        if now.breaks != before.breaks {
            self.plant.break_legs(&now.breaks, self.comparator_a());
        }
        if now.blocked != before.blocked {
            self.plant.block(now.blocked);
        }
        self.plant.kick(now.kicked_rad_s - before.kicked_rad_s);
        if now.wind_rad_s != before.wind_rad_s {
            self.plant.set_wind_rad_s(now.wind_rad_s);
        }
        if now.torque_nm != before.torque_nm {
            self.plant.set_extra_torque_nm(now.torque_nm);
        }
        self.bus.sag(now.sag_v);
        self.bus.limit(now.brown_out_v);
        self.bus.connect(!now.disconnected);
        let sound = self.bench.sensing;
        let offset = |phase: usize| sound.offset_a[phase] + now.drift_a[phase];
        self.sensing = Sensing {
            noise_a: libm::hypot(sound.noise_a, now.noise_a),
            offset_a: [0, 1, 2].map(offset),
            ..sound
        };
        self.stuck_a = now.stuck_a;
        self.hall_stuck = now.hall;
    }

    /// Where a board's comparators turn the bridge off: 1.6 times `LIM_PHASE_A` where the drive's own
    /// trip is at 1.4, and never above what the board can measure, A.
    fn comparator_a(&self) -> f64 {
        let trip_counts: f64 = self.config.protection.trip.to_num();
        let per_count_a = f64::from(self.sensing.board(self.bench.delay).current_a_per_count);
        (trip_counts * per_count_a * (1.6 / 1.4)).min(self.sensing.range_a)
    }

    /// Holds the chip in reset, with the bridge off, or lets it run.
    pub fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// Whether the chip is held in reset.
    pub fn is_held(&self) -> bool {
        self.held
    }

    /// Voltage of the bus, V.
    pub fn bus_v(&self) -> f64 {
        self.bus.volts()
    }

    /// Motor, load and inverter.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The control's configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What the tasks may know of the control.
    pub fn snapshot(&self) -> Snapshot {
        self.state.snapshot()
    }

    /// λ̂ of the phases in the order of the configured direction, Wb, where the control observes flux
    /// crossings; else zero.
    pub fn flux_linkages_wb(&self) -> [f64; 3] {
        let flux_wb = f64::from(self.config.scale.flux_wb());
        let lambda = self.state.flux_linkages();
        lambda.map(|flux| flux.to_num::<f64>() * flux_wb)
    }

    /// Every word of the control state.
    #[inline(always)]
    pub fn trace(&self, out: &mut impl FnMut(u32)) {
        self.state.trace(&self.config, out);
    }

    /// Temperature of the board as its thermistor shows it, °C.
    pub fn temperature_c(&self) -> f32 {
        self.thermal.measured_c()
    }

    /// Length of a control period, s.
    pub fn period_s(&self) -> f64 {
        f64::from(self.config.scale.period_s)
    }

    /// The control's state.
    pub(crate) fn state(&self) -> &State {
        &self.state
    }

    /// Dead time of the inverter, s.
    pub(crate) fn dead_time_s(&self) -> f64 {
        self.bench.dead_time_s.unwrap_or_else(|| {
            let share: f64 = self.config.dead_time.duty.to_num();
            share * self.period_s()
        })
    }

    /// Tells the control where the rotor is.
    fn tell(&mut self, angle_turns: f64, speed_rad_s: f64) {
        let pole_pairs = f64::from(self.bench.motor.pole_pairs);
        let turns = speed_rad_s * pole_pairs * self.period_s() / TAU;
        let (theta, omega) = (
            Angle::wrapping_from_num(angle_turns),
            Speed::saturating_from_num(turns),
        );
        self.state.place(theta, omega);
    }

    /// The next control period.
    pub fn period(&mut self, setpoint: Setpoint) -> Period {
        let setpoint = if self.plant.tripped() {
            Setpoint::Fault(Fault::OverCurrent)
        } else {
            setpoint
        };
        let currents_a = self.plant.currents_a();
        let (angle_turns, speed_rad_s) = (self.plant.angle_turns(), self.plant.speed_rad_s());
        let truth = Truth {
            currents_a: self.plant.shunts_a(currents_a),
            low_s: self.plant.low_s(),
            terminals_v: self.plant.terminals_v(),
            bus_v: self.bus.volts(),
            direction: self.plant.direction(),
        };
        let mut sample = self.sensing.sample(&truth, &mut self.noise);
        for (counts, stuck_a) in sample.currents.iter_mut().zip(self.stuck_a) {
            if let Some(stuck_a) = stuck_a {
                *counts = self.sensing.stuck(stuck_a);
            }
        }
        for (phase, stuck) in self.hall_stuck.into_iter().enumerate() {
            if let Some(level) = stuck {
                sample.hall = sample.hall & !(1 << phase) | u8::from(level) << phase;
            }
        }
        if self.bench.position == Position::Ideal {
            self.tell(angle_turns, speed_rad_s);
        }
        let bridge = if self.held {
            Bridge::Off
        } else {
            drive::step(&self.config, &mut self.state, sample, setpoint)
        };

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
        let dead_time_s = self.dead_time_s();
        let bus_v = self.bus.volts();
        let flow = self.plant.period(halves, bus_v, period_s, dead_time_s);
        self.bus.advance(period_s, flow.bus_a);
        let current_square = flow.copper_w / (1.5 * self.plant.resistance_ohm());
        self.thermal.advance(period_s, current_square);
        Period {
            sample,
            setpoint,
            bridge,
            halves,
            angle_turns,
            speed_rad_s,
            currents_a,
            bus_v,
            bus_a: flow.bus_a,
            flow,
        }
    }
}

impl Bench {
    /// The control's configuration with this bench's source of the rotor's position.
    fn observed(&self, config: Config) -> Config {
        match self.position {
            Position::Observer => config,
            Position::Ideal => config.with_position_given(),
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
