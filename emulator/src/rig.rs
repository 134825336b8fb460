//! One drive on its bench: the control's step against the plant, period by period.

use std::f64::consts::TAU;

use siskin_control::drive::{self, Bridge, Config, Fault, Sample, Setpoint, Snapshot, State};
use siskin_params::Delay;
use siskin_units::{Angle, Speed};

pub use crate::bench::{Bench, Position};
use crate::fault::InForce;
use crate::plant::Plant;
use crate::surroundings::{Motion, Surroundings};

/// What was read and done at a sample, and its effect until the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    /// What the converter read.
    pub sample: Sample,
    /// The drive's set-point.
    pub setpoint: Setpoint,
    /// The bridge's command.
    pub bridge: Bridge,
    /// What the bridge did in each half, after the delay.
    pub halves: [Bridge; 2],
    /// The motor.
    pub motion: Motion,
}

/// A drive on its bench.
#[derive(Clone, Debug)]
pub struct Rig {
    around: Surroundings,
    config: Config,
    state: State,
    /// What the bridge does until the latest command takes effect.
    applied: Bridge,
    /// Whether the chip is in reset.
    held: bool,
}

impl Rig {
    /// Starts the bench, with the control at power-up.
    pub fn new(bench: Bench, config: Config) -> Self {
        let config = bench.observed(config);
        Self {
            state: State::new(&config),
            around: Surroundings::new(bench),
            applied: Bridge::Off,
            held: false,
            config,
        }
    }

    /// Replaces the control's configuration, as the tasks do between two periods.
    ///
    /// The period's length remains as at the start.
    pub fn configure(&mut self, config: Config) {
        let config = self.around.bench().observed(config);
        self.state.adopt(&self.config, &config);
        self.config = config;
    }

    /// Restarts the control, as after a reset of the chip; the plant goes on.
    pub fn restart(&mut self, config: Config) {
        let config = self.around.bench().observed(config);
        self.state = State::new(&config);
        self.config = config;
        self.applied = Bridge::Off;
    }

    /// Replaces the faults that act.
    pub fn disturb(&mut self, before: &InForce, now: &InForce) {
        self.around.disturb(before, now);
    }

    /// Returns where a board's comparators turn the bridge off: 1.6 times `LIM_PHASE_A`, with the drive's own trip at
    /// 1.4, and never above what the board can measure, A. They rise with the limit, and fall with the drive's trip.
    fn comparator_a(&self) -> f64 {
        let trip = self.config.protection.trip.max(self.state.trip_level());
        let trip_counts: f64 = trip.to_num();
        let Bench { sensing, delay, .. } = self.around.bench();
        let per_count_a = f64::from(sensing.board(*delay).current_a_per_count);
        (trip_counts * per_count_a * (1.6 / 1.4)).min(sensing.range_a)
    }

    /// Holds the chip in reset, with the bridge off, or releases it.
    pub fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// Returns true if the chip is held in reset.
    pub fn is_held(&self) -> bool {
        self.held
    }

    /// Returns the bus voltage, V.
    pub fn bus_v(&self) -> f64 {
        self.around.bus_v()
    }

    /// Returns everything outside the chip.
    pub fn around(&self) -> &Surroundings {
        &self.around
    }

    /// Returns everything outside the chip, for changes.
    pub fn around_mut(&mut self) -> &mut Surroundings {
        &mut self.around
    }

    /// Returns motor, load and inverter.
    pub fn plant(&self) -> &Plant {
        self.around.plant()
    }

    /// Returns the control's configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Returns what the tasks may know of the control.
    pub fn snapshot(&self) -> Snapshot {
        self.state.snapshot()
    }

    /// Returns λ̂ of the phases in the order of the configured direction, Wb, if the control observes flux crossings;
    /// else zero.
    pub fn flux_linkages_wb(&self) -> [f64; 3] {
        let flux_wb = f64::from(self.config.scale.flux_wb());
        let lambda = self.state.flux_linkages();
        lambda.map(|flux| flux.to_num::<f64>() * flux_wb)
    }

    /// Returns the adapted inductance over the stated one.
    pub fn inductance(&self) -> f64 {
        self.state.inductance().get().to_num()
    }

    /// Passes every word of the control state to `out`.
    pub fn trace(&self, out: &mut impl FnMut(u32)) {
        self.state.trace(&self.config, out);
    }

    /// Returns the board's temperature by its thermistor, °C.
    pub fn temperature_c(&self) -> f32 {
        self.around.temperature_c()
    }

    /// Returns the length of a control period, s.
    pub fn period_s(&self) -> f64 {
        f64::from(self.config.scale.period_s)
    }

    /// Returns the control's state.
    pub(crate) fn state(&self) -> &State {
        &self.state
    }

    /// Returns the inverter's dead time, s.
    pub(crate) fn dead_time_s(&self) -> f64 {
        self.around.bench().dead_time_s.unwrap_or_else(|| {
            let share: f64 = self.config.dead_time.share.to_num();
            share * self.period_s()
        })
    }

    /// Tells the control where the rotor is.
    fn tell(&mut self) {
        let plant = self.around.plant();
        let (angle_turns, speed_rad_s) = (plant.angle_turns(), plant.speed_rad_s());
        let pole_pairs = f64::from(self.around.bench().motor.pole_pairs);
        let turns = speed_rad_s * pole_pairs * self.period_s() / TAU;
        let (theta, omega) = (
            Angle::wrapping_from_num(angle_turns),
            Speed::saturating_from_num(turns),
        );
        self.state.place(theta, omega);
    }

    /// Runs the next control period.
    pub fn period(&mut self, setpoint: Setpoint) -> Period {
        let setpoint = if self.around.plant().tripped() {
            Setpoint::Fault(Fault::OverCurrent)
        } else {
            setpoint
        };
        let sample = self.around.sample();
        let bench = self.around.bench();
        let (position, delay) = (bench.position, bench.delay);
        if position == Position::Ideal {
            self.tell();
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
        let halves = match delay {
            Delay::None(_) => [bridge, bridge],
            Delay::Half(_) => [before, bridge],
            Delay::One => [before, before],
        };
        self.applied = bridge;
        let (period_s, dead_time_s) = (self.period_s(), self.dead_time_s());
        self.around.set_comparator_a(self.comparator_a());
        Period {
            sample,
            setpoint,
            bridge,
            halves,
            motion: self.around.period(halves, period_s, dead_time_s),
        }
    }
}

impl Period {
    /// Returns the estimated less true electrical angle at the sample, degrees, ±180.
    pub fn angle_error_deg(&self, snapshot: &Snapshot) -> f64 {
        self.motion.angle_error_deg(snapshot)
    }

    /// Returns the mechanical speed, rpm.
    pub fn rpm(&self) -> f64 {
        self.motion.rpm()
    }
}

#[cfg(test)]
mod tests {
    use siskin_control::build::build;
    use siskin_params::{BOSSO_BENCH, ParamId, Params};

    use super::*;

    fn limited_to(limit_a: f32) -> Config {
        let mut params = Params::of(&BOSSO_BENCH);
        params.set(ParamId::LimPhaseA, limit_a).expect("in range");
        let bench = Bench::default();
        build(&params, &bench.sensing.board(bench.delay)).expect("it fits the bench")
    }

    #[test]
    fn the_comparators_go_down_behind_the_current_and_up_at_once() {
        let mut rig = Rig::new(Bench::default(), limited_to(20.0));
        let near = |rig: &Rig, wanted_a: f64| (rig.comparator_a() - wanted_a).abs() < 0.1;
        let fast = Setpoint::Speed(rig.config().scale.speed_from_rpm(5000.0));
        for _ in 0..48_000 {
            rig.period(fast);
        }
        rig.configure(limited_to(2.0));
        rig.period(fast);
        assert!(near(&rig, 32.0), "{}", rig.comparator_a());
        for _ in 0..1000 {
            rig.period(fast);
        }
        assert!(near(&rig, 3.2), "{}", rig.comparator_a());
        rig.configure(limited_to(10.0));
        assert!(near(&rig, 16.0), "{}", rig.comparator_a());
        assert!(rig.snapshot().faults.is_empty());
    }
}
