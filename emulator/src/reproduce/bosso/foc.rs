//! The paper's field-oriented control of section III: the drive's own control, given the true angle, holds a constant
//! torque at a constant speed.

use std::f64::consts::TAU;

use siskin_control::build::build;
use siskin_control::drive::{Bridge, Phase, Setpoint};
use siskin_params::{BOSSO_BENCH, Delay, ParamId, Params};

use super::course::{Course, Legs};
use super::means::{Means, seek};
use super::setting::{BUS_V, CARRIER_HZ, MOTOR, PHASES, exact_sensing};
use crate::plant::{Fidelity, Load, Rail, Supply};
use crate::rig::{Bench, Position, Rig};

/// Time of Run after which the current has settled: 47 time constants of its loop, s.
const SETTLE_S: f64 = 0.02;

/// Longest time until Run, s.
const START_S: f64 = 0.2;

/// How the common-mode voltage is chosen, numbered like `CTL_MODULATION`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Modulation {
    SpaceVector,
    Sine,
}

/// A constant speed and torque.
#[derive(Clone, Copy, Debug)]
pub(super) struct Foc {
    /// Mechanical speed, rpm.
    pub(super) rpm: f64,
    /// T*, Nm.
    pub(super) torque_nm: f64,
    /// The modulation.
    pub(super) modulation: Modulation,
    /// Dead time of the inverter, compensated by the control as usual, s.
    pub(super) dead_time_s: f64,
}

impl Foc {
    /// Finds the T* that gives the wanted mean torque: the control holds the current at the samples, which is not its
    /// mean.
    pub(super) fn at_torque(self, wanted_nm: f64, time_s: f64) -> Self {
        let with = |torque_nm| Self { torque_nm, ..self };
        let torque = |torque_nm| with(torque_nm).measure(time_s).torque_nm();
        with(seek(wanted_nm, [wanted_nm, 1.02 * wanted_nm], torque))
    }

    /// Measures for a total time, from several initial rotor angles; returns nothing if the drive does not run
    /// throughout.
    pub(super) fn measure(&self, time_s: f64) -> Means {
        let mut all = Means::default();
        for part in 0..PHASES {
            let settled = self.settled(f64::from(part) / f64::from(PHASES), |_| {});
            let Some(mut rig) = settled else {
                return Means::default();
            };
            let setpoint = self.setpoint(&rig);
            let mut means = Means::default();
            let periods = libm::round(time_s / f64::from(PHASES) * CARRIER_HZ) as u32;
            for _ in 0..periods {
                means.add(&rig.period(setpoint).motion.flow, rig.period_s());
                if rig.snapshot().phase != Phase::Run {
                    return Means::default();
                }
            }
            all = all.join(&means);
        }
        all
    }

    /// Returns the torque over a time, as s since its start and Nm, from the bridge's commands of a run from the start
    /// on, edge by edge. Empty if the drive does not run.
    pub(super) fn waveform(&self, time_s: f64) -> Vec<(f64, f64)> {
        let mut bridges = vec![Bridge::Off];
        let Some(mut rig) = self.settled(0.0, |bridge| bridges.push(bridge)) else {
            return Vec::new();
        };
        let setpoint = self.setpoint(&rig);
        let drawn = libm::round(time_s * CARRIER_HZ) as usize;
        for _ in 0..drawn {
            bridges.push(rig.period(setpoint).bridge);
        }
        // A command acts in the period after its own.
        bridges.pop();
        let mut course = Course::new(self.rpm, 0.0);
        let settling = bridges.len() - drawn;
        for (period, bridge) in bridges.into_iter().enumerate() {
            if period == settling {
                course.draw();
            }
            for (legs, stretch_s) in edges(bridge) {
                course.run(legs, stretch_s);
            }
        }
        course.waveform
    }

    /// Returns a rig that has held the torque for long enough; `each` sees every command until then. `None` if the
    /// drive does not reach Run in time, or leaves it.
    fn settled(&self, angle_turns: f64, mut each: impl FnMut(Bridge)) -> Option<Rig> {
        let bench = Bench {
            load: Load::default(),
            supply: Supply::stiff(BUS_V),
            plant: Fidelity::Switching,
            position: Position::Ideal,
            sensing: exact_sensing(),
            delay: Delay::One,
            dead_time_s: Some(self.dead_time_s),
            imposed_rad_s: Some(self.rpm * TAU / 60.0),
            initial_angle_turns: angle_turns,
            ..Bench::default()
        };
        let mut params = Params::of(&BOSSO_BENCH);
        let modulation = match self.modulation {
            Modulation::SpaceVector => 0.0,
            Modulation::Sine => 1.0,
        };
        for (id, value) in [
            (ParamId::PwmFreqHz, CARRIER_HZ as f32),
            (ParamId::PwmDeadtimeNs, (self.dead_time_s * 1e9) as f32),
            (ParamId::CtlModulation, modulation),
            // One PI per axis, with back-EMF compensation.
            (ParamId::CtlRegulator, 1.0),
            (ParamId::LimPhaseA, 25.0),
        ] {
            // Each is in the table's range.
            let _ = params.set(id, value);
        }
        let config = build(&params, &bench.sensing.board(bench.delay))
            .expect("the defaults fit the bench, and 15 kHz has time for the converter");
        let mut rig = Rig::new(bench, config);
        let setpoint = self.setpoint(&rig);
        let (start, settle) = (periods(START_S), periods(SETTLE_S));
        let mut running = 0;
        for _ in 0..start + settle {
            let period = rig.period(setpoint);
            each(period.bridge);
            if rig.snapshot().phase == Phase::Run {
                running += 1;
            } else if running > 0 {
                return None;
            }
            if running == settle {
                return Some(rig);
            }
        }
        None
    }

    fn setpoint(&self, rig: &Rig) -> Setpoint {
        let amps = self.torque_nm / (1.5 * f64::from(MOTOR.pole_pairs) * MOTOR.flux_wb);
        Setpoint::Torque(rig.config().scale.current_from_a(amps as f32))
    }
}

fn periods(time_s: f64) -> u32 {
    libm::round(time_s * CARRIER_HZ) as u32
}

/// Returns the edges of a command's period without dead time, from sample to sample: each leg is high about the middle.
fn edges(bridge: Bridge) -> Vec<(Legs, f64)> {
    let period_s = 1.0 / CARRIER_HZ;
    let Bridge::Duty(duties) = bridge else {
        // The drive does not run yet. Charging its drivers leaves no lasting current.
        return vec![([None; 3], period_s)];
    };
    let rises = duties.map(|duty| 0.5 * (1.0 - duty.to_num::<f64>().min(1.0)));
    let mut times: Vec<f64> = rises.iter().flat_map(|rise| [*rise, 1.0 - rise]).collect();
    times.push(1.0);
    times.sort_by(f64::total_cmp);
    let mut now = 0.0;
    let stretches = times.into_iter().map(|time| {
        let middle = 0.5 * (now + time);
        let legs = rises.map(|rise| {
            let high = (rise..1.0 - rise).contains(&middle);
            Some(if high { Rail::High } else { Rail::Low })
        });
        let stretch_s = (time - now) * period_s;
        now = time;
        (legs, stretch_s)
    });
    stretches.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRIVE: Foc = Foc {
        rpm: 4500.0,
        torque_nm: 0.0972,
        modulation: Modulation::Sine,
        dead_time_s: 0.0,
    };

    #[test]
    fn the_torque_is_held() {
        let got = DRIVE.at_torque(0.0972, 0.02).measure(0.02).torque_nm();
        assert!((got - 0.0972).abs() < 1e-5, "{got}");
    }

    /// At 20,000 rpm the back-EMF is three times what 24 V can overcome.
    #[test]
    fn a_drive_that_does_not_run_measures_nothing() {
        let drive = Foc {
            rpm: 20_000.0,
            ..DRIVE
        };
        assert!(drive.measure(0.02).torque_nm().is_nan());
    }

    /// Three electrical turns are 50 periods of the carrier: both see the same ones.
    #[test]
    fn the_waveform_is_that_of_the_measured_run() {
        let waveform = DRIVE.waveform(3.0 / 900.0);
        let measured = DRIVE.measure(4.0 * 3.0 / 900.0);
        let mean = |f: fn(f64) -> f64| {
            let values = waveform.iter().map(|(_, torque_nm)| f(*torque_nm));
            values.sum::<f64>() / waveform.len() as f64
        };
        let torque_nm = mean(|torque_nm| torque_nm);
        let ripple_pct = 100.0 * (mean(|x| x * x) / torque_nm.powi(2) - 1.0).sqrt();
        assert!(
            (torque_nm / measured.torque_nm() - 1.0).abs() < 0.01,
            "{torque_nm}"
        );
        assert!(
            (ripple_pct - measured.ripple_pct()).abs() < 1.0,
            "{ripple_pct}"
        );
    }
}
