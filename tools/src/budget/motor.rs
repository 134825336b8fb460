//! The motor and the settings that a budget is made for: from parameters and from the command line.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use siskin_control::params::{FluxSettings, Kind, ParamId, Params, SetError};

use super::limits::{HoldOff, Settings};
use crate::cli::BudgetArgs;
use crate::error::Error;
use crate::param_file;

/// The component of an ESC beside an autopilot: whose lines a file of several components is read
/// for by default.
const PERIPHERAL: u8 = 140;

/// A motor and what its angle is found with.
pub(crate) struct Motor {
    pub(crate) pole_pairs: f64,
    pub(crate) settings: Settings,
}

impl Motor {
    /// What the arguments say over what the parameters do.
    ///
    /// # Errors
    /// [`Error::Usage`] or [`Error::File`].
    pub(crate) fn of(args: &BudgetArgs, component: Option<u8>) -> Result<Self, Error> {
        let mut params = Params::default();
        if let Some(file) = &args.file {
            read(&mut params, file, component.unwrap_or(PERIPHERAL))?;
        }
        for text in &args.params {
            assign(&mut params, text)?;
        }
        let pole_pairs = args.pole_pairs.or(args.poles.map(|poles| poles / 2));
        for (id, value) in [
            (ParamId::MotPolePairs, pole_pairs.map(f64::from)),
            (ParamId::CtlSlewRpmS, args.acceleration.filter(|x| *x > 0.0)),
            (ParamId::PwmFreqHz, args.pwm),
        ] {
            if let Some(value) = value {
                set(&mut params, id, value as f32).map_err(Error::Usage)?;
            }
        }
        let get = |id| f64::from(params.get(id));
        let pole_pairs = get(ParamId::MotPolePairs);
        let rad_s_per_rpm = pole_pairs * TAU / 60.0;
        let acceleration = args.acceleration.unwrap_or(get(ParamId::CtlSlewRpmS));
        let drive = FluxSettings::new(&params);
        // What is given as in the paper counts at every speed.
        let from = |given: Option<f64>, above_hz: f32| match given {
            Some(_) => 0.0,
            None => f64::from(above_hz) * TAU,
        };
        let drive_hpfs_s = match args.tau_int {
            Some(_) => None,
            None => drive.tau_hpfs_s.map(f64::from),
        };
        Ok(Self {
            pole_pairs,
            settings: Settings {
                tau_int_s: args.tau_int.unwrap_or(f64::from(drive.tau_int_s)),
                tau_hpfs_s: args.tau_hpfs.or(drive_hpfs_s),
                hold_off: match args.hold_off {
                    Some(time_us) => HoldOff::Time(time_us * 1e-6),
                    None => HoldOff::Angle(f64::from(drive.hold_off_turns) * 360.0),
                },
                turns: args.turns.unwrap_or(f64::from(drive.turns)),
                every_edge: args.turns.is_none(),
                whole_turns_above: from(args.turns, drive.whole_turns_above_hz),
                a_e: args.a_e.unwrap_or(f64::from(drive.a_e)),
                filter_above: from(args.a_e, drive.filter_above_hz),
                period_s: 1.0 / get(ParamId::PwmFreqHz),
                acceleration: acceleration * rad_s_per_rpm,
                braking: args.braking.unwrap_or(acceleration) * rad_s_per_rpm,
            },
        })
    }

    /// Mechanical speed, rpm, of an electrical one in rad/s; and likewise of accelerations.
    pub(crate) fn rpm(&self, omega: f64) -> f64 {
        omega * 60.0 / (TAU * self.pole_pairs)
    }
}

/// Takes the parameters of a file over those that there are.
fn read(params: &mut Params, file: &Path, component: u8) -> Result<(), Error> {
    let failed = |reason: String| Error::File {
        path: file.display().to_string(),
        reason,
    };
    let content = fs::read_to_string(file).map_err(|error| failed(error.to_string()))?;
    let lines = param_file::read(&content).map_err(|bad| failed(bad.join("; ")))?;
    let lines = param_file::for_component(lines, component);
    if lines.is_empty() {
        return Err(failed(format!(
            "it has no setting for component {component}"
        )));
    }
    for line in &lines {
        let (name, value) = (&line.param.name, line.param.value);
        let id = find(name).map_err(|reason| failed(format!("line {}: {reason}", line.number)))?;
        // A file that was saved has the derived ones too.
        if id.entry().kind != Kind::Derived {
            set(params, id, value)
                .map_err(|reason| failed(format!("line {}: {reason}", line.number)))?;
        }
    }
    Ok(())
}

/// Takes one `NAME=VALUE`.
fn assign(params: &mut Params, text: &str) -> Result<(), Error> {
    let usage = |reason: String| Error::Usage(format!("--param {text}: {reason}"));
    let (name, value) = text
        .split_once('=')
        .ok_or_else(|| usage("write NAME=VALUE".to_owned()))?;
    let id = find(&name.to_ascii_uppercase()).map_err(usage)?;
    let value = value
        .parse()
        .map_err(|_| usage(format!("'{value}' is not a number")))?;
    set(params, id, value).map_err(usage)
}

fn find(name: &str) -> Result<ParamId, String> {
    ParamId::find(name).ok_or_else(|| format!("no parameter is called {name}"))
}

fn set(params: &mut Params, id: ParamId, value: f32) -> Result<(), String> {
    let entry = id.entry();
    params.set(id, value).map_err(|error| match error {
        SetError::ReadOnly => format!("{} is computed from others", entry.name),
        SetError::NotWhole => format!("{} takes whole numbers", entry.name),
        SetError::NotFinite | SetError::OutOfRange => format!(
            "{} is {} to {} {}, and {value} is not",
            entry.name,
            entry.min,
            entry.max,
            id.text().unit
        ),
    })
}
