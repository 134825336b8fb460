//! What `siskin params` prints and does.

use std::fs;
use std::io::Write;
use std::path::Path;

use serde_json::{Map, Value};

use crate::cli::ParamsCommand;
use crate::error::Error;
use crate::json::number;
use crate::param_file::{self, Line};
use crate::param_load::load;
use crate::params::{self, Param, SetOutcome};
use crate::session::Session;

/// Work on parameters whose input has been checked, so that nothing is sent where any of it is bad.
pub(crate) enum Task<'a> {
    List {
        json: bool,
    },
    Get {
        names: Vec<String>,
        json: bool,
    },
    Set {
        params: Vec<Param>,
        store: bool,
    },
    Save {
        file: &'a Path,
    },
    Load {
        file: &'a Path,
        lines: Vec<Line>,
        store: bool,
    },
}

impl<'a> Task<'a> {
    /// Checks names and values, and reads the file to load; each of its bad lines is listed on
    /// `complaints`.
    ///
    /// # Errors
    /// [`Error::Usage`] or [`Error::File`].
    pub(crate) fn check(
        command: &'a ParamsCommand,
        complaints: &mut dyn Write,
    ) -> Result<Self, Error> {
        Ok(match command {
            ParamsCommand::List { json } => Self::List { json: *json },
            ParamsCommand::Get { json, names } => {
                let names = names.iter().map(|name| checked_name(name));
                Self::Get {
                    names: names.collect::<Result<_, _>>()?,
                    json: *json,
                }
            }
            ParamsCommand::Set { store, pairs } => Self::Set {
                params: names_and_values(pairs)?,
                store: *store,
            },
            ParamsCommand::Save { file } => Self::Save { file },
            ParamsCommand::Load { store, file } => {
                let content = fs::read_to_string(file).map_err(|e| file_error(file, &e))?;
                Self::Load {
                    file,
                    lines: sound_lines(file, &content, complaints)?,
                    store: *store,
                }
            }
        })
    }

    /// Does it, with results on `out` and complaints about single parameters on `complaints`.
    ///
    /// # Errors
    /// Any [`Error`].
    pub(crate) fn run(
        self,
        session: &mut Session,
        out: &mut dyn Write,
        complaints: &mut dyn Write,
    ) -> Result<(), Error> {
        match self {
            Self::List { json } => print(&params::list(session)?, json, out),
            Self::Get { names, json } => get(session, &names, json, out, complaints),
            Self::Set { params, store } => {
                let refused = set(session, &params, out, complaints)?;
                finish(session, store, refused, params.len(), out)
            }
            Self::Save { file } => {
                let params = params::list(session)?;
                fs::write(file, param_file::write(session.target(), &params))
                    .map_err(|e| file_error(file, &e))?;
                writeln!(out, "{}: {} parameters", file.display(), params.len())?;
                Ok(())
            }
            Self::Load { file, lines, store } => {
                let component = session.target().component;
                let lines = param_file::for_component(lines, component);
                if lines.is_empty() {
                    return Err(Error::File {
                        path: file.display().to_string(),
                        reason: format!("it has no setting for component {component}"),
                    });
                }
                let refused = load(session, &lines, out, complaints)?;
                finish(session, store, refused, lines.len(), out)
            }
        }
    }
}

/// The name as an ESC has it: a person may write it in any case.
fn checked_name(name: &str) -> Result<String, Error> {
    if params::is_name(name) {
        return Ok(name.to_ascii_uppercase());
    }
    Err(Error::Usage(format!(
        "'{name}' is not a parameter name: 1 to {} characters without spaces; \
         'siskin params list' shows all",
        params::NAME_LENGTH
    )))
}

fn sound_lines(file: &Path, content: &str, complaints: &mut dyn Write) -> Result<Vec<Line>, Error> {
    param_file::read(content).or_else(|bad| {
        for text in &bad {
            writeln!(complaints, "{}: {text}", file.display())?;
        }
        Err(Error::File {
            path: file.display().to_string(),
            reason: format!("{} bad; nothing was sent", counted(bad.len(), "line")),
        })
    })
}

/// `1 line`, `2 lines`.
fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

fn names_and_values(pairs: &[String]) -> Result<Vec<Param>, Error> {
    pairs
        .chunks(2)
        .map(|pair| {
            let [name, value] = pair else {
                return Err(Error::Usage(format!(
                    "'{}' has no value; write NAME VALUE in turn",
                    pair.join(" ")
                )));
            };
            let name = checked_name(name)?;
            match value.parse::<f32>() {
                Ok(number) if number.is_finite() => Ok(Param {
                    name,
                    value: number,
                }),
                _ => Err(Error::Usage(format!(
                    "'{value}' is not a number for {name}"
                ))),
            }
        })
        .collect()
}

fn file_error(file: &Path, error: &std::io::Error) -> Error {
    Error::File {
        path: file.display().to_string(),
        reason: error.to_string(),
    }
}

pub(crate) fn print(params: &[Param], json: bool, out: &mut dyn Write) -> Result<(), Error> {
    if json {
        let object: Map<String, Value> = params
            .iter()
            .map(|p| (p.name.clone(), number(p.value)))
            .collect();
        writeln!(out, "{}", Value::Object(object))?;
    } else {
        for Param { name, value } in params {
            writeln!(out, "{name:<width$} {value}", width = params::NAME_LENGTH)?;
        }
    }
    Ok(())
}

fn get(
    session: &mut Session,
    names: &[String],
    json: bool,
    out: &mut dyn Write,
    complaints: &mut dyn Write,
) -> Result<(), Error> {
    let mut found = Vec::new();
    for name in names {
        match params::get(session, name) {
            Ok(value) => found.push(Param {
                name: name.clone(),
                value,
            }),
            Err(Error::Refused { what, reason }) => writeln!(complaints, "{what}: {reason}")?,
            Err(other) => return Err(other),
        }
    }
    print(&found, json, out)?;
    let missing = names.len() - found.len();
    if missing > 0 {
        return Err(Error::Partly(format!(
            "{missing} of {} not read",
            counted(names.len(), "parameter")
        )));
    }
    Ok(())
}

/// Sends each value; the number of those refused.
fn set(
    session: &mut Session,
    params: &[Param],
    out: &mut dyn Write,
    complaints: &mut dyn Write,
) -> Result<usize, Error> {
    let mut refused = 0;
    for param in params {
        let Param { name, value } = param;
        match params::set(session, name, *value)? {
            SetOutcome::Taken => print(std::slice::from_ref(param), false, out)?,
            SetOutcome::Refused(reason) => {
                refused += 1;
                writeln!(complaints, "{name} {value}: refused: {reason}")?;
            }
        }
    }
    Ok(refused)
}

/// Stores where that was asked for and everything was taken.
fn finish(
    session: &mut Session,
    store: bool,
    refused: usize,
    of: usize,
    out: &mut dyn Write,
) -> Result<(), Error> {
    if refused > 0 {
        let stored = if store { "; nothing was stored" } else { "" };
        return Err(Error::Partly(format!(
            "{refused} of {} refused{stored}",
            counted(of, "value")
        )));
    }
    if store {
        params::store(session)?;
        writeln!(out, "stored")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_checked_before_anything_is_sent() {
        let pairs = |words: &[&str]| {
            let words: Vec<String> = words.iter().map(|&w| w.into()).collect();
            names_and_values(&words).map_err(|e| e.to_string())
        };
        assert_eq!(
            pairs(&["A", "-1.5"]),
            Ok(vec![Param {
                name: "A".into(),
                value: -1.5
            }])
        );
        assert_eq!(
            pairs(&["mot_Stop", "0"]),
            Ok(vec![Param {
                name: "MOT_STOP".into(),
                value: 0.0
            }])
        );
        for (words, complaint) in [
            (&["A", "1", "B"][..], "'B' has no value"),
            (&["A", "fast"][..], "'fast' is not a number for A"),
            (&["A", "inf"][..], "'inf' is not a number for A"),
            (&["SEVENTEEN_LETTERS", "1"][..], "not a parameter name"),
        ] {
            let message = pairs(words).expect_err("bad input");
            assert!(message.contains(complaint), "{message}");
        }
    }
}
