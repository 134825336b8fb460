//! `siskin tune`: the settings of start and control loops that follow from a motor.

mod rules;

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::io::Write;

use serde_json::{Map, Value};
use siskin_control::params::{ParamId, Params};

use crate::cli::TuneArgs;
use crate::error::Error;
use crate::params::{NAME_LENGTH, Param};
use crate::{given, json, param_file, param_text};
use rules::Setting;

/// The motor, and what else its settings are made of.
const MADE_OF: [ParamId; 10] = [
    ParamId::MotPolePairs,
    ParamId::MotRMohm,
    ParamId::MotLUh,
    ParamId::MotFluxMwb,
    ParamId::MotJGcm2,
    ParamId::CtlRpmMax,
    ParamId::PwmFreqHz,
    ParamId::PwmDeadtimeNs,
    ParamId::LimPhaseA,
    ParamId::LimBusVMax,
];

/// Computes the settings, prints them and writes the file. `component` is whose parameters a file of several
/// gives.
///
/// # Errors
/// [`Error::Usage`] or [`Error::File`] for bad input.
pub(crate) fn run(
    args: &TuneArgs,
    component: Option<u8>,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let mut params = given::params(&args.given, component)?;
    let set = |params: &mut _, id, value| given::set(params, id, value).map_err(Error::Usage);
    if let Some(poles) = args.poles {
        set(&mut params, ParamId::MotPolePairs, (poles / 2) as f32)?;
    }
    if let Some(kv) = args.kv {
        let flux_mwb = flux_mwb(kv, &params);
        set(&mut params, ParamId::MotFluxMwb, flux_mwb)?;
    }
    let before = params.clone();
    let settings = rules::settings(&params);
    for Setting { id, value, .. } in &settings {
        set(&mut params, *id, *value)?;
    }
    if let Some(path) = &args.output {
        let of_motor = MADE_OF
            .iter()
            .chain(settings.iter().map(|setting| &setting.id));
        let mut ids: Vec<_> = of_motor.copied().collect();
        ids.sort_by_key(|id| *id as usize);
        ids.dedup();
        let lines: Vec<_> = ids.into_iter().map(|id| param(&params, id)).collect();
        let text = param_file::write("a motor and its settings", &lines);
        fs::write(path, text).map_err(|error| Error::file(path, error))?;
    }
    if args.json {
        let values = settings.iter().map(|setting| {
            let name = setting.id.entry().name.to_owned();
            (name, json::number(setting.value))
        });
        writeln!(out, "{}", Value::Object(values.collect::<Map<_, _>>()))?;
    } else {
        write!(out, "{}", table(&before, &settings))?;
    }
    Ok(())
}

/// The flux linkage of a motor of these pole pairs, by its KV.
fn flux_mwb(kv: f64, params: &Params) -> f32 {
    let pole_pairs = f64::from(params.get(ParamId::MotPolePairs));
    (1e3 * 60.0 / (TAU * 3_f64.sqrt() * pole_pairs * kv)) as f32
}

fn param(params: &Params, id: ParamId) -> Param {
    Param {
        name: id.entry().name.into(),
        value: params.get(id),
    }
}

/// The motor, and each setting with what it was and what it follows from.
fn table(before: &Params, settings: &[Setting]) -> String {
    let mut out = String::new();
    let mut line = |name: &str, value: &str, was: &str, from: &str| {
        // A String takes all that is written to it.
        let _ = writeln!(
            out,
            "{}",
            format!("{name:<NAME_LENGTH$} {value:<14} {was:<14} {from}").trim_end()
        );
    };
    let text = |id: ParamId, value| param_text::value(id.entry().name, value);
    line("made of", "", "", "");
    for id in MADE_OF {
        line(id.entry().name, &text(id, before.get(id)), "", "");
    }
    line("", "", "", "");
    line("setting", "value", "before", "from");
    for Setting { id, value, from } in settings {
        line(
            id.entry().name,
            &text(*id, *value),
            &text(*id, before.get(*id)),
            from,
        );
    }
    out
}
