//! `siskin tune`: the settings of the start and the control loops that follow from a motor, and its top speed.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::io::Write;

use serde_json::{Map, Value, json};
use siskin_control::build::BuildError;
use siskin_params::{FromMotor, ParamId, Params};

use crate::cli::TuneArgs;
use crate::error::Error;
use crate::params::{NAME_LENGTH, Param};
use crate::top_speed::TopSpeed;
use crate::{given, json, param_file, param_text};

/// The motor, and what else its settings are computed from.
const MADE_OF: [ParamId; 9] = [
    ParamId::MotPolePairs,
    ParamId::MotRMohm,
    ParamId::MotLUh,
    ParamId::MotFluxMwb,
    ParamId::MotJGcm2,
    ParamId::CtlRpmMax,
    ParamId::PwmDeadtimeNs,
    ParamId::LimPhaseA,
    ParamId::LimBusVMax,
];

/// A setting in force.
struct Setting {
    id: ParamId,
    value: f32,
    /// What it follows from.
    from: &'static str,
}

/// Computes the settings, prints them and writes the file. `component` selects whose parameters to take from
/// a file with several.
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
    if params.is_default(ParamId::CtlRpmMin) {
        // 300 rpm suits the first bench's motor.
        set(&mut params, ParamId::CtlRpmMin, 0.0)?;
    }
    let made = params.in_force();
    let followed = FromMotor::new(&made).reasons(&params);
    let settings = followed.map(|(id, value, from)| Setting { id, value, from });
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
    let supply_v = args
        .supply
        .unwrap_or_else(|| made.get(ParamId::LimBusVMax).into());
    let (least_v, most_v) = (ParamId::LimBusVMin, ParamId::LimBusVMax);
    let [least_v, most_v] = [least_v, most_v].map(|id| f64::from(made.get(id)));
    if !(least_v..=most_v).contains(&supply_v) {
        let why = format!(
            "--supply {supply_v} is not within LIM_BUS_V_MIN, {least_v} V, and LIM_BUS_V_MAX, {most_v} V"
        );
        return Err(Error::Usage(why));
    }
    let top_speed = TopSpeed::new(&params, supply_v);
    if args.json {
        let values = settings.iter().map(|setting| {
            let name = setting.id.entry().name.to_owned();
            (name, json::number(setting.value))
        });
        let mut values: Map<_, _> = values.collect();
        if args.top_speed {
            values.insert("top_speed".to_owned(), top_speed_json(&top_speed));
        }
        writeln!(out, "{}", Value::Object(values))?;
    } else {
        write!(out, "{}", table(&params, &made, &settings))?;
        write!(out, "{}", top_speed_table(&top_speed, supply_v))?;
    }
    Ok(())
}

/// Returns a motor's flux linkage from its KV and its pole pairs, assumed if not given.
fn flux_mwb(kv: f64, params: &Params) -> f32 {
    let pole_pairs = f64::from(params.in_force().get(ParamId::MotPolePairs));
    (1e3 * 60.0 / (TAU * 3_f64.sqrt() * pole_pairs * kv)) as f32
}

fn param(params: &Params, id: ParamId) -> Param {
    Param {
        name: id.entry().name.into(),
        value: params.get(id),
    }
}

/// Returns the motor, with what is assumed about it, and each setting in force with what it follows from.
fn table(params: &Params, made: &Params, settings: &[Setting]) -> String {
    let mut out = String::new();
    let mut line = |name: &str, value: &str, from: &str| {
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{}",
            format!("{name:<NAME_LENGTH$} {value:<14} {from}").trim_end()
        );
    };
    line("made of", "", "");
    for id in MADE_OF {
        let name = id.entry().name;
        let value = made.get(id);
        let (value, from) = if value == params.get(id) {
            (value, "")
        } else {
            (three_digits(value), "assumed: the motor is not known")
        };
        line(name, &param_text::value(name, value), from);
    }
    line("", "", "");
    line("setting", "value", "from");
    for Setting { id, value, from } in settings {
        let name = id.entry().name;
        line(name, &param_text::value(name, three_digits(*value)), from);
    }
    out
}

/// Returns the top speed with its bounds, the lowest first; null if the parameters make no drive.
fn top_speed_json(top_speed: &Result<TopSpeed, BuildError>) -> Value {
    let Ok(top_speed) = top_speed else {
        return Value::Null;
    };
    let bounds = top_speed.bounds.iter();
    let bounds = bounds.map(|bound| json!({"name": bound.name, "rpm": bound.rpm.round()}));
    json!({
        "bounds": bounds.collect::<Vec<_>>(),
        "turn_periods": json::fixed(top_speed.turn_periods, 1).parse::<f64>().ok(),
    })
}

/// Returns the bounds of the speed, the lowest first.
fn top_speed_table(top_speed: &Result<TopSpeed, BuildError>, supply_v: f64) -> String {
    let top_speed = match top_speed {
        Ok(top_speed) => top_speed,
        Err(error) => {
            let name = error.param.entry().name;
            return format!("\nno drive: {name}: {}\n", error.reason);
        }
    };
    let mut out = format!("\ntop speed at {supply_v} V without a propeller, the lowest counts\n");
    for bound in &top_speed.bounds {
        let rpm = format!("{:.0} rpm", bound.rpm);
        // Writing to a String cannot fail.
        let _ = writeln!(
            out,
            "{:<NAME_LENGTH$} {rpm:<14} {}",
            bound.name, bound.reason
        );
    }
    let periods = json::fixed(top_speed.turn_periods, 1);
    out + &format!("PWM periods in an electrical turn there: {periods}\n")
}

/// Rounds to as many digits as people read.
fn three_digits(value: f32) -> f32 {
    format!("{value:.2e}").parse().unwrap_or(value)
}
