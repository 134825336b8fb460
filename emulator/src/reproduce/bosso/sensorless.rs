//! Section V's benches: the drives without a position sensor, with the propeller.

use std::f64::consts::TAU;

use siskin_control::build::build;
use siskin_control::drive::{Phase, Setpoint};
use siskin_params::{BOSSO_BENCH, BOSSO_TABLE_III, ParamId, Params};

use super::means::Means;
use super::setting::{BUS_V, exact_sensing, load_nm};
use crate::bench::{Choice, MotorTable};
use crate::plant::{Fidelity, Load, Sensing, Supply};
use crate::rig::{Bench, Rig};

/// The motor of Table I with what the paper's had beyond its model.
const REAL_MOTOR: &str = "antigravity-4006-kv380-real";

/// Inertia of motor and propeller (section V), kg·m².
const INERTIA_KGM2: f64 = 1.43e-4;

/// Time over which a steady speed is measured, s.
const MEASURE_S: f64 = 0.4;

/// How close to a real bench the simulation is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Realism {
    /// The motor of (1) to (3), exact sensing, no dead time.
    Ideal,
    /// That motor; 12 bits, 0.05 A of noise and 500 ns of dead time, which the control compensates.
    Board,
    /// The same board; a motor with harmonics, iron loss, detents and a winding that heats up.
    Motor,
}

/// A drive of section V.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Drive {
    /// The published observer and controller with the gains of Table III, 15 kHz.
    Published,
    /// Six-step by zero crossings, 40 kHz.
    SixStep,
}

impl Drive {
    fn params(self) -> &'static [(ParamId, f32)] {
        match self {
            Self::Published => BOSSO_TABLE_III.settings,
            Self::SixStep => &[(ParamId::CtlDrive, 1.0), (ParamId::PwmFreqHz, 40_000.0)],
        }
    }

    /// Creates its rig with the propeller at a speed.
    pub(super) fn rig(self, initial_rpm: f64, realism: Realism) -> Rig {
        let (sensing, dead_time_ns) = match realism {
            Realism::Board | Realism::Motor => (Sensing::default(), 500.0),
            Realism::Ideal => (exact_sensing(), 0.0),
        };
        let default = Bench::default();
        let (motor, extras) = match realism {
            Realism::Board | Realism::Ideal => (default.motor, default.extras),
            Realism::Motor => Choice::<MotorTable>::Named(REAL_MOTOR.to_owned())
                .motor()
                .expect("the built-in benches are tested"),
        };
        let rated_rad_s = 4500.0 * TAU / 60.0;
        let bench = Bench {
            motor,
            extras,
            load: Load {
                c2: load_nm(4500.0) / (rated_rad_s * rated_rad_s),
                inertia_kgm2: INERTIA_KGM2,
                ..Load::default()
            },
            supply: Supply::stiff(BUS_V),
            plant: Fidelity::Switching,
            sensing,
            initial_rad_s: initial_rpm * TAU / 60.0,
            ..default
        };
        let mut params = Params::of(&BOSSO_BENCH);
        let dead_time = (ParamId::PwmDeadtimeNs, dead_time_ns);
        for (id, value) in self.params().iter().chain(&[dead_time]) {
            // Each is in the table's range.
            let _ = params.set(*id, *value);
        }
        let config = build(&params, &bench.sensing.board(bench.delay))
            .expect("a preset makes a drive, and 40 kHz has four periods a sextant at 6000 rpm");
        Rig::new(bench, config)
    }

    /// Settles at a speed and measures: power figures, and the mean angle error in degrees; nothing if the drive leaves
    /// Run.
    pub(super) fn at(self, rpm: f64, realism: Realism) -> (Means, f64) {
        // One is caught in flight, the other starts from standstill.
        let (initial_rpm, settle_s) = match self {
            Self::Published => (rpm, 1.0),
            Self::SixStep => (0.0, 2.5),
        };
        let mut rig = self.rig(initial_rpm, realism);
        let setpoint = Setpoint::Speed(rig.config().scale.speed_from_rpm(rpm as f32));
        let periods = |time_s: f64| libm::round(time_s / rig.period_s()) as u32;
        let (settle, measure) = (periods(settle_s), periods(MEASURE_S));
        for _ in 0..settle {
            rig.period(setpoint);
        }
        let mut means = Means::default();
        let mut error_deg = 0.0;
        for _ in 0..measure {
            let period = rig.period(setpoint);
            means.add(&period.motion.flow, rig.period_s());
            let snapshot = rig.snapshot();
            if snapshot.phase != Phase::Run {
                return (Means::default(), f64::NAN);
            }
            error_deg += period.angle_error_deg(&snapshot);
        }
        (means, error_deg / f64::from(measure))
    }
}
