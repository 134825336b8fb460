//! Measures the emulator's speed on this machine: simulated seconds per second of one thread, as a
//! ratio to the [`yardstick`], and how the time divides among its parts.
//!
//! The workload is the default bench at 15 kHz with all of the control, the sensors' noise and
//! quantisation, its shaft settled at 4500 rpm. Control and plant are then timed separately on the
//! data they exchanged in that run, so that each repeats the same work.

use std::fmt;
use std::fs;
use std::hint::black_box;
use std::mem;
use std::time::Instant;

use serde::Serialize;
use siskin_control::build::{BuildError, build};
use siskin_control::drive::{self, Bridge, Sample, Setpoint};
use siskin_params::{BOSSO_BENCH, Delay, ParamId, Params};

use crate::plant::Fidelity;
use crate::rig::{Bench, Rig};
use crate::yardstick::{self, Yardstick};

/// Periods until the shaft has settled: 4 s.
const SETTLING: usize = 60_000;

/// Periods per measurement: 60 electrical turns, and less than a millisecond, so that most fit
/// between two scheduler ticks and the median is of undisturbed ones.
const MEASURED: usize = 1_000;

/// Measurements of each kind, interleaved, so that a changing clock rate affects all alike.
const ROUNDS: usize = 1_001;

/// The figures; each is the median of several runs.
#[derive(Clone, Debug, Serialize)]
pub struct Figures {
    /// Simulated seconds per second with the averaged plant.
    pub averaged_sim_per_wall: f64,
    /// The same with the switching plant.
    pub switching_sim_per_wall: f64,
    /// The same for the yardstick.
    pub yardstick_sim_per_wall: f64,
    /// With the averaged plant, relative to the yardstick.
    pub averaged_ratio: f64,
    /// The same with the switching plant.
    pub switching_ratio: f64,
    /// The control's step, ns.
    pub step_ns: f64,
    /// A period of the averaged plant, ns.
    pub plant_averaged_ns: f64,
    /// A period of the switching plant, ns.
    pub plant_switching_ns: f64,
    /// The control's share of a period with the averaged plant; what is neither its nor the plant's
    /// is the sensors'.
    pub averaged_control_share: f64,
    /// The plant's share of it.
    pub averaged_plant_share: f64,
    /// The control's share of a period with the switching plant.
    pub switching_control_share: f64,
    /// The plant's share of it.
    pub switching_plant_share: f64,
    /// The processor's name.
    pub cpu: String,
}

/// Measures for some seconds, on one thread.
///
/// # Errors
/// The control cannot be configured.
pub fn measure() -> Result<Figures, BuildError> {
    let averaged = Run::settled(Fidelity::Averaged)?;
    let switching = Run::settled(Fidelity::Switching)?;
    let mut yardstick = Yardstick::new();
    (0..SETTLING).for_each(|_| yardstick.period());

    let rounds: Vec<_> = (0..ROUNDS)
        .map(|_| Round {
            yardstick_ns: time_ns(yardstick.clone(), |yardstick, _| yardstick.period()),
            averaged_ns: averaged.whole_ns(),
            switching_ns: switching.whole_ns(),
            step_ns: averaged.step_ns(),
            plant_averaged_ns: averaged.plant_ns(),
            plant_switching_ns: switching.plant_ns(),
        })
        .collect();
    let of = |figure: &dyn Fn(&Round) -> f64| median(rounds.iter().map(figure));
    let sim_per_wall = |ns: f64| yardstick::PERIOD_S * 1e9 / ns;
    Ok(Figures {
        averaged_sim_per_wall: of(&|round| sim_per_wall(round.averaged_ns)),
        switching_sim_per_wall: of(&|round| sim_per_wall(round.switching_ns)),
        yardstick_sim_per_wall: of(&|round| sim_per_wall(round.yardstick_ns)),
        averaged_ratio: of(&|round| round.yardstick_ns / round.averaged_ns),
        switching_ratio: of(&|round| round.yardstick_ns / round.switching_ns),
        step_ns: of(&|round| round.step_ns),
        plant_averaged_ns: of(&|round| round.plant_averaged_ns),
        plant_switching_ns: of(&|round| round.plant_switching_ns),
        averaged_control_share: of(&|round| round.step_ns / round.averaged_ns),
        averaged_plant_share: of(&|round| round.plant_averaged_ns / round.averaged_ns),
        switching_control_share: of(&|round| round.step_ns / round.switching_ns),
        switching_plant_share: of(&|round| round.plant_switching_ns / round.switching_ns),
        cpu: cpu(),
    })
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        writeln!(
            f,
            "{}, one thread: a 15 kHz drive at {} rpm, medians of {ROUNDS} runs",
            self.cpu,
            yardstick::RPM
        )?;
        writeln!(
            f,
            "           times real time  of the yardstick  control   plant"
        )?;
        let speed = self.yardstick_sim_per_wall;
        writeln!(f, "yardstick  {speed:15.1}")?;
        let rows = [
            (
                "averaged",
                [self.averaged_sim_per_wall, self.averaged_ratio],
                [self.averaged_control_share, self.averaged_plant_share],
            ),
            (
                "switching",
                [self.switching_sim_per_wall, self.switching_ratio],
                [self.switching_control_share, self.switching_plant_share],
            ),
        ];
        for (name, [speed, ratio], [control, plant]) in rows {
            let (control, plant) = (100.0 * control, 100.0 * plant);
            writeln!(
                f,
                "{name:9}  {speed:15.1}  {ratio:16.2}  {control:5.0} %  {plant:4.0} %"
            )?;
        }
        writeln!(
            f,
            "a period of the control takes {:.0} ns, of the averaged plant {:.0} ns, of the \
             switching plant {:.0} ns",
            self.step_ns, self.plant_averaged_ns, self.plant_switching_ns
        )
    }
}

/// What each part took in one round, ns per period.
struct Round {
    yardstick_ns: f64,
    averaged_ns: f64,
    switching_ns: f64,
    step_ns: f64,
    plant_averaged_ns: f64,
    plant_switching_ns: f64,
}

/// A settled run of the emulator, and the data exchanged between its parts from there on.
struct Run {
    rig: Rig,
    setpoint: Setpoint,
    samples: Vec<Sample>,
    /// In force from each sample to the next: with a period of delay, the previous command.
    commands: Vec<Bridge>,
}

impl Run {
    fn settled(fidelity: Fidelity) -> Result<Self, BuildError> {
        let bench = Bench {
            plant: fidelity,
            delay: Delay::One,
            ..Bench::default()
        };
        let mut params = Params::of(&BOSSO_BENCH);
        // It is in the table's range.
        let _ = params.set(ParamId::PwmFreqHz, (1.0 / yardstick::PERIOD_S) as f32);
        let config = build(&params, &bench.sensing.board(bench.delay))?;
        let setpoint = Setpoint::Speed(config.scale.speed_from_rpm(yardstick::RPM as f32));
        let mut rig = Rig::new(bench, config);
        let mut command = Bridge::Off;
        for _ in 0..SETTLING {
            command = rig.period(setpoint).bridge;
        }
        let mut ahead = rig.clone();
        let (samples, commands) = (0..MEASURED)
            .map(|_| {
                let period = ahead.period(setpoint);
                (period.sample, mem::replace(&mut command, period.bridge))
            })
            .unzip();
        Ok(Self {
            rig,
            setpoint,
            samples,
            commands,
        })
    }

    /// Returns the time of a whole period, ns.
    fn whole_ns(&self) -> f64 {
        time_ns(self.rig.clone(), |rig, _| rig.period(self.setpoint))
    }

    /// Returns the time of a control step, ns.
    fn step_ns(&self) -> f64 {
        time_ns(self.rig.state().clone(), |state, k| {
            drive::step(self.rig.config(), state, self.samples[k], self.setpoint)
        })
    }

    /// Returns the time of a plant period, ns.
    fn plant_ns(&self) -> f64 {
        let rig = &self.rig;
        let (period_s, dead_time_s) = (rig.period_s(), rig.dead_time_s());
        let bus_v = rig.bus_v();
        time_ns(rig.plant().clone(), |plant, k| {
            plant.period([self.commands[k]; 2], bus_v, period_s, dead_time_s)
        })
    }
}

/// Returns the time that some work takes per period, ns.
fn time_ns<S, T>(mut state: S, mut period: impl FnMut(&mut S, usize) -> T) -> f64 {
    let began = Instant::now();
    for k in 0..MEASURED {
        black_box(period(&mut state, k));
    }
    black_box(&mut state);
    began.elapsed().as_secs_f64() * 1e9 / MEASURED as f64
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<_> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Returns the processor's name, if the system tells it.
fn cpu() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| {
        let (key, value) = line.split_once(':')?;
        (key.trim() == "model name").then(|| value.trim().to_owned())
    });
    name.unwrap_or_else(|| "unknown".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Control and plant do the same apart as together.
    #[test]
    fn the_parts_are_those_of_the_whole() {
        for fidelity in [Fidelity::Averaged, Fidelity::Switching] {
            let run = Run::settled(fidelity).unwrap();
            let (mut rig, mut state) = (run.rig.clone(), run.rig.state().clone());
            let mut plant = rig.plant().clone();
            for k in 0..MEASURED {
                drive::step(rig.config(), &mut state, run.samples[k], run.setpoint);
                let halves = [run.commands[k]; 2];
                let bus_v = rig.bus_v();
                plant.period(halves, bus_v, rig.period_s(), rig.dead_time_s());
                let rpm = rig.period(run.setpoint).rpm();
                assert!((rpm - yardstick::RPM).abs() < 10.0, "{rpm}");
            }
            assert_eq!(state.snapshot(), rig.snapshot());
            assert_eq!(plant.currents_a(), rig.plant().currents_a());
            assert_eq!(plant.speed_rad_s(), rig.plant().speed_rad_s());
        }
    }
}
