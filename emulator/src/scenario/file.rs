//! A scenario as given by its file.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use siskin_params::{Delay, ParamId, parts};
use toml::{Table, Value};

use super::ScenarioError;
use super::fault::FaultTable;
use super::lines::reason;
use super::signal::Signal;
use super::wire::Wire;
use crate::bench::{
    Choice, DEFAULT_LOAD, DEFAULT_MOTOR, LoadTable, MotorTable, SupplyTable, library,
};
use crate::fault::Fault;
use crate::parameter::parameter;
use crate::plant::{BOARD_K_PER_W, Fidelity, Sensing};
use crate::rig::{Bench, Position};

/// The fastest decay of currents integrated in steps, 1/s: 500 steps in a period of 50 µs.
const DECAY_MAX_PER_S: f64 = 1e6;

/// The whole file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Scenario {
    /// The bench: the truth.
    #[serde(default)]
    pub(super) bench: BenchTable,
    /// What the control believes.
    #[serde(default)]
    pub(super) params: BTreeMap<String, f32>,
    /// What the drive is commanded, in order.
    #[serde(default)]
    pub(super) signal: Vec<Signal>,
    /// The faults.
    #[serde(default)]
    pub(super) fault: Vec<FaultTable>,
    /// The measuring windows.
    #[serde(default)]
    pub(super) window: Vec<WindowTable>,
    /// The figures' required values.
    #[serde(default)]
    pub(super) expect: Vec<Expectation>,
    /// Keys of this file with the values that each takes in turn.
    #[serde(default)]
    pub(super) sweep: BTreeMap<String, Vec<Value>>,
    /// Keys of this file with what each is drawn from by the seed.
    #[serde(default)]
    pub(super) random: BTreeMap<String, Draw>,
}

/// What a value is drawn from.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "give [least, greatest] as numbers, or { of = [...] }"
)]
pub(super) enum Draw {
    /// Uniformly from whole numbers.
    Whole([i64; 2]),
    /// Uniformly from a range.
    Real([f64; 2]),
    /// One of these.
    OneOf {
        /// The values.
        of: Vec<Value>,
    },
}

/// The bench; omitted keys take the value of its base, or else of the Bosso bench.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct BenchTable {
    /// The bench that this one extends, by name or path; see [`crate::bench::library`].
    pub(super) base: Option<String>,
    /// A built-in name, a file or a table.
    pub(super) motor: Choice<MotorTable>,
    /// Likewise.
    pub(super) load: Choice<LoadTable>,
    /// Volts, a pack as "6s", a file or a table.
    pub(super) bus: Choice<SupplyTable>,
    /// How the inverter is simulated.
    pub(super) plant: Fidelity,
    /// Where the control gets the rotor's position.
    pub(super) position: Position,
    /// Speed at which the shaft is held.
    pub(super) imposed_rpm: Option<f64>,
    /// Seed of all randomness.
    pub(super) seed: u64,
    /// Simulated time.
    pub(super) duration_s: f64,
    /// How throttle is sent.
    pub(super) wire: Wire,
    /// Resolution of the currents; 0 is exact.
    pub(super) adc_bits: u32,
    /// Periods from sample to voltage: 0, 0.5 or 1.
    pub(super) delay_periods: f64,
    /// The truth relative to the named motor and load.
    pub(super) scale: Factors,
    /// Full scale of the currents.
    pub(super) adc_range_a: f64,
    /// Noise of the currents, rms.
    pub(super) noise_a: f64,
    /// Zero error of each current.
    pub(super) offset_a: [f64; 3],
    /// Gain of each current.
    pub(super) gain: [f64; 3],
    /// Time constant of the current amplifiers.
    pub(super) settling_ns: f64,
    /// Electrical degrees by which each Hall sensor switches late.
    pub(super) hall_error_deg: [f64; 3],
    /// Dead time of the inverter.
    pub(super) dead_time_ns: f64,
    /// Thermal resistance of the board.
    pub(super) board_k_per_w: f64,
    /// Initial speed.
    pub(super) initial_rpm: f64,
    /// Initial electrical angle.
    pub(super) initial_angle_deg: f64,
}

impl Default for BenchTable {
    fn default() -> Self {
        Self {
            base: None,
            motor: Choice::Named(DEFAULT_MOTOR.to_owned()),
            load: Choice::Named(DEFAULT_LOAD.to_owned()),
            bus: Choice::Named("24".to_owned()),
            plant: Fidelity::Averaged,
            position: Position::Observer,
            imposed_rpm: None,
            seed: 1,
            duration_s: 3.0,
            wire: Wire::default(),
            adc_bits: 12,
            delay_periods: 1.0,
            scale: Factors::default(),
            adc_range_a: 40.0,
            noise_a: 0.05,
            offset_a: [0.0; 3],
            gain: [1.0; 3],
            settling_ns: 100.0,
            hall_error_deg: [0.0; 3],
            dead_time_ns: 500.0,
            board_k_per_w: BOARD_K_PER_W,
            initial_rpm: 0.0,
            initial_angle_deg: 0.0,
        }
    }
}

/// The truth relative to the named motor and load.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Factors {
    #[serde(rename = "R")]
    r: f64,
    #[serde(rename = "L")]
    l: f64,
    flux: f64,
    #[serde(rename = "J")]
    j: f64,
    load: f64,
}

impl Default for Factors {
    fn default() -> Self {
        Self {
            r: 1.0,
            l: 1.0,
            flux: 1.0,
            j: 1.0,
            load: 1.0,
        }
    }
}

/// A measuring window.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WindowTable {
    /// Name.
    pub(super) name: String,
    /// Start.
    pub(super) t0_s: f64,
    /// End.
    pub(super) t1_s: f64,
}

/// The window by which an expectation names the whole run.
pub(super) const RUN: &str = "run";

/// The required value of a figure.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Expectation {
    /// The window's name, or `run` for the whole run.
    pub(super) window: String,
    /// The figure's key in the summary.
    pub(super) key: String,
    /// It must be less.
    pub(super) below: Option<f64>,
    /// It must be more.
    pub(super) above: Option<f64>,
    /// It must be this, give or take `within`, which defaults to 0.
    pub(super) equals: Option<f64>,
    /// See `equals`.
    pub(super) within: Option<f64>,
}

impl Expectation {
    /// Returns a key with what is wrong with its value: nothing compares with NaN, and whatever there is is below
    /// infinity, so that such an expectation would not say anything.
    pub(super) fn problem(&self) -> Option<(&'static str, String)> {
        let bounds = [
            ("below", self.below),
            ("above", self.above),
            ("equals", self.equals),
            ("within", self.within),
        ];
        let given = bounds
            .iter()
            .filter_map(|(key, bound)| Some((*key, (*bound)?)));
        for (key, bound) in given {
            if !bound.is_finite() {
                return Some((key, format!("{bound} is no bound; give a finite number")));
            }
            if key == "within" && bound < 0.0 {
                return Some((key, format!("{bound} is less than nothing; give 0 or more")));
            }
        }
        None
    }
}

impl BenchTable {
    /// Returns the bench.
    pub(super) fn bench(&self) -> Result<Bench, ScenarioError> {
        let range = |key, value: f64, least: f64, most: f64| {
            if (least..=most).contains(&value) {
                Ok(value)
            } else {
                Err(ScenarioError::Range {
                    key,
                    value,
                    least,
                    most,
                })
            }
        };
        range("bench.duration_s", self.duration_s, 0.0, 1e5)?;
        let factors = self.scale;
        for (key, factor) in [
            ("bench.scale.R", factors.r),
            ("bench.scale.L", factors.l),
            ("bench.scale.flux", factors.flux),
            ("bench.scale.J", factors.j),
        ] {
            range(key, factor, 0.01, 100.0)?;
        }
        range("bench.scale.load", factors.load, 0.0, 100.0)?;
        let (mut motor, extras) = self.motor.motor()?;
        motor.resistance_ohm *= factors.r;
        motor.inductance_h *= factors.l;
        motor.flux_wb *= factors.flux;
        motor.inertia_kgm2 *= factors.j;
        if !extras.is_linear() {
            let least_h =
                2.0 * motor.inductance_h * extras.saliency.min(1.0) / (1.0 + extras.saliency);
            range(
                "R/L of a motor with harmonics, saliency or saturation",
                motor.resistance_ohm / least_h,
                0.0,
                DECAY_MAX_PER_S,
            )?;
        }
        let mut load = self.load.load()?;
        load.c1 *= factors.load;
        load.c2 *= factors.load;
        load.torque_nm *= factors.load;
        load.inertia_kgm2 *= factors.j;
        range(
            "J of motor and load",
            motor.inertia_kgm2 + load.inertia_kgm2,
            1e-9,
            1e6,
        )?;
        let delay = match self.delay_periods {
            0.0 => Delay::None(parts::Bench::HERE),
            0.5 => Delay::Half(parts::Bench::HERE),
            1.0 => Delay::One,
            other => return Err(ScenarioError::Delay(other)),
        };
        let three = |key, [a, b, c]: [f64; 3], least, most| {
            let one = |value| range(key, value, least, most);
            Ok::<_, ScenarioError>([one(a)?, one(b)?, one(c)?])
        };
        Ok(Bench {
            motor,
            extras,
            load,
            supply: self.bus.supply()?,
            plant: self.plant,
            position: self.position,
            sensing: Sensing {
                range_a: range("bench.adc_range_a", self.adc_range_a, 0.1, 1e3)?,
                bits: range("bench.adc_bits", f64::from(self.adc_bits), 0.0, 24.0)? as u32,
                noise_a: range("bench.noise_a", self.noise_a, 0.0, 1e3)?,
                offset_a: three("bench.offset_a", self.offset_a, -1e3, 1e3)?,
                gain: three("bench.gain", self.gain, 0.1, 10.0)?,
                settling_s: range("bench.settling_ns", self.settling_ns, 0.0, 1e5)? * 1e-9,
                hall_error_deg: three("bench.hall_error_deg", self.hall_error_deg, -60.0, 60.0)?,
            },
            delay,
            dead_time_s: Some(range("bench.dead_time_ns", self.dead_time_ns, 0.0, 1e4)? * 1e-9),
            board_k_per_w: range("bench.board_k_per_w", self.board_k_per_w, 0.0, 100.0)?,
            imposed_rad_s: match self.imposed_rpm {
                Some(rpm) => Some(rad_s(range("bench.imposed_rpm", rpm, -2e5, 2e5)?)),
                None => None,
            },
            initial_rad_s: rad_s(range("bench.initial_rpm", self.initial_rpm, -2e5, 2e5)?),
            initial_angle_turns: range(
                "bench.initial_angle_deg",
                self.initial_angle_deg,
                -3600.0,
                3600.0,
            )? / 360.0,
            seed: self.seed,
        })
    }
}

impl Scenario {
    /// Reads the scenario from the tables of a file in this folder, on the bench that they name as their base.
    pub(super) fn read(root: Table, folder: &Path) -> Result<Self, ScenarioError> {
        Self::understand(Self::complete(root, folder)?)
    }

    /// Completes the tables with those of the bench that they name as their base.
    pub(super) fn complete(mut root: Table, folder: &Path) -> Result<Table, ScenarioError> {
        library::complete(&mut root, folder, &|text, table| {
            let alone = Self::alone(text, table);
            alone.map_err(|error| error.in_file(text, &[]).to_string())
        })?;
        Ok(root)
    }

    /// Checks that a bench's file makes sense by itself; `table` is its parsed text.
    fn alone(text: &str, table: &Table) -> Result<(), ScenarioError> {
        toml::from_str::<Self>(text)
            .map_err(|error| ScenarioError::Syntax(reason(text, &error)))?;
        let scenario = Self::understand(table.clone())?;
        scenario.bench.bench()?;
        scenario.params()?;
        Ok(())
    }

    /// Reads the scenario from complete tables.
    pub(super) fn understand(root: Table) -> Result<Self, ScenarioError> {
        Self::deserialize(root).map_err(|error| {
            let message = error.message().replace('\n', " ");
            ScenarioError::Syntax(message)
        })
    }

    /// Returns the faults.
    pub(super) fn faults(&self) -> Result<Vec<Fault>, ScenarioError> {
        let faults = self.fault.iter().enumerate();
        faults
            .map(|(index, table)| {
                let wrong = |(key, problem): (&str, String)| {
                    ScenarioError::of_key(format!("fault.{index}.{key}"), problem)
                };
                table.fault().map_err(wrong)
            })
            .collect()
    }

    /// Returns the parameters that the file sets.
    pub(super) fn params(&self) -> Result<Vec<(ParamId, f32)>, ScenarioError> {
        self.params
            .iter()
            .map(|(name, value)| {
                let wrong = |problem| ScenarioError::of_key(format!("params.{name}"), problem);
                parameter(name, *value).map_err(wrong)
            })
            .collect()
    }
}

fn rad_s(rpm: f64) -> f64 {
    rpm * std::f64::consts::TAU / 60.0
}
