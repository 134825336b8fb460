//! Parameters given without an ESC: from a file and from the command line.

use std::fs;
use std::path::Path;

use siskin_params::{Kind, ParamId, Params, SetError};

use crate::cli::GivenArgs;
use crate::error::Error;
use crate::param_file;

/// The component of an ESC beside an autopilot: the default for a file with several components.
const PERIPHERAL: u8 = 140;

/// Returns the factory parameters, overridden by the arguments. `component` selects the lines of a file
/// with several components.
///
/// # Errors
/// [`Error::Usage`] or [`Error::File`].
pub(crate) fn params(args: &GivenArgs, component: Option<u8>) -> Result<Params, Error> {
    let mut params = Params::default();
    if let Some(file) = &args.file {
        read(&mut params, file, component.unwrap_or(PERIPHERAL))?;
    }
    for text in &args.params {
        assign(&mut params, text)?;
    }
    Ok(params)
}

/// Overrides the parameters with those in a file.
fn read(params: &mut Params, file: &Path, component: u8) -> Result<(), Error> {
    let failed = |reason: String| Error::file(file, reason);
    let content = fs::read_to_string(file).map_err(|error| Error::file(file, error))?;
    let lines = param_file::read(&content).map_err(|bad| failed(bad.join("; ")))?;
    for line in param_file::for_component(file, lines, component)? {
        let (name, value) = (&line.param.name, line.param.value);
        let id = find(name).map_err(|reason| failed(format!("line {}: {reason}", line.number)))?;
        // A saved file holds the derived ones too.
        if id.entry().kind != Kind::Derived {
            set(params, id, value)
                .map_err(|reason| failed(format!("line {}: {reason}", line.number)))?;
        }
    }
    Ok(())
}

/// Applies one `NAME=VALUE`.
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

/// Sets a parameter, or says why it does not accept the value.
pub(crate) fn set(params: &mut Params, id: ParamId, value: f32) -> Result<(), String> {
    let entry = id.entry();
    params.set(id, value).map_err(|error| match error {
        SetError::ReadOnly => format!("{} is computed from others", entry.name),
        SetError::NotWhole => format!("{} takes whole numbers", entry.name),
        SetError::NotFinite | SetError::OutOfRange => format!(
            "{} is {} {}, and {value} is not",
            entry.name,
            entry.range(),
            id.text().unit
        ),
    })
}
