//! What `siskin params` prints and does.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::{Map, Value};

use crate::cli::ParamsCommand;
use crate::error::Error;
use crate::factory::Factory;
use crate::json::number;
use crate::message::name_of;
use crate::param_file::{self, Line};
use crate::param_load::{load, same};
use crate::param_text;
use crate::params::{self, Param, SetOutcome, Storage};
use crate::session::Session;

/// How long to wait for what the ESC says of the parameters together.
const TOLD_AFTER: Duration = Duration::from_millis(800);

/// Parameter work with checked input, so that nothing is sent if any of it is bad.
pub(crate) enum Task<'a> {
    List {
        json: bool,
    },
    Get {
        names: Vec<String>,
        json: bool,
    },
    Describe {
        names: Vec<String>,
    },
    Diff {
        /// A file and its valid lines; `None` for the factory values.
        against: Option<(&'a Path, Vec<Line>)>,
    },
    Reset {
        /// `None` for all.
        names: Option<Vec<String>>,
        store: bool,
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
    /// Checks names and values, and reads the file to load; lists each of its bad lines on `complaints`.
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
            ParamsCommand::Describe { names } => {
                let names = names.iter().map(|name| checked_name(name));
                Self::Describe {
                    names: names.collect::<Result<_, _>>()?,
                }
            }
            ParamsCommand::Diff { file } => Self::Diff {
                against: match file {
                    Some(file) => Some((file, read(file, complaints)?)),
                    None => None,
                },
            },
            ParamsCommand::Reset { store, all, names } => Self::Reset {
                names: if *all {
                    None
                } else {
                    let names = names.iter().map(|name| checked_factory_name(name));
                    Some(names.collect::<Result<_, _>>()?)
                },
                store: *store,
            },
            ParamsCommand::Set { store, pairs } => Self::Set {
                params: names_and_values(pairs)?,
                store: *store,
            },
            ParamsCommand::Save { file } => Self::Save { file },
            ParamsCommand::Load { store, file } => Self::Load {
                file,
                lines: read(file, complaints)?,
                store: *store,
            },
        })
    }

    /// Does the work, with results on `out` and complaints about single parameters on `complaints`.
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
            Self::Get { names, json } => {
                let (found, ended) = get(session, &names, complaints)?;
                print(&found, json, out)?;
                ended
            }
            Self::Describe { names } => {
                let (found, ended) = if names.is_empty() {
                    (params::list(session)?, Ok(()))
                } else {
                    get(session, &names, complaints)?
                };
                let factory = Factory::ask(session)?;
                for param in &found {
                    param_text::describe(param, factory.value(&param.name), out)?;
                }
                ended
            }
            Self::Diff { against: None } => {
                let factory = Factory::ask(session)?;
                diff_to_factory(&params::list(session)?, &factory, out)
            }
            Self::Diff {
                against: Some((file, lines)),
            } => {
                let lines = param_file::for_component(file, lines, session.target().component)?;
                diff_to_file(&params::list(session)?, file, &lines, out)
            }
            Self::Reset {
                names: None,
                store: _,
            } => {
                params::storage(session, Storage::Reset)?;
                writeln!(out, "all parameters reset to factory values, and stored")?;
                Ok(())
            }
            Self::Reset {
                names: Some(names),
                store,
            } => {
                let factory = Factory::ask(session)?;
                // If the ESC does not have it, it will say so.
                let params = names.into_iter().map(|name| Param {
                    value: factory.value(&name).unwrap_or_default(),
                    name,
                });
                let params = params.collect();
                Self::Set { params, store }.run(session, out, complaints)
            }
            Self::Set { params, store } => {
                let refused = set(session, &params, out, complaints)?;
                tell_unfit(session, complaints)?;
                finish(session, store, refused, params.len(), out)
            }
            Self::Save { file } => {
                let params = params::list(session)?;
                fs::write(file, param_file::write(&name_of(session.target()), &params))
                    .map_err(|e| Error::file(file, e))?;
                writeln!(out, "{}: {} parameters", file.display(), params.len())?;
                Ok(())
            }
            Self::Load { file, lines, store } => {
                let lines = param_file::for_component(file, lines, session.target().component)?;
                let refused = load(session, &lines, out, complaints)?;
                tell_unfit(session, complaints)?;
                finish(session, store, refused, lines.len(), out)
            }
        }
    }
}

/// Waits for what the ESC says of the parameters together, half a second after the last: with some, its motor stays off.
fn tell_unfit(session: &mut Session, complaints: &mut dyn Write) -> Result<(), Error> {
    session.forget_texts();
    let deadline = Instant::now() + TOLD_AFTER;
    while session.hear(deadline)? {
        if let Some(text) = session.texts(&["Motor off: "]).pop() {
            writeln!(complaints, "{text}")?;
            break;
        }
    }
    Ok(())
}

/// Returns the name as an ESC has it: it may be typed in any case.
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

/// Checks the name of a parameter that has a factory value.
fn checked_factory_name(name: &str) -> Result<String, Error> {
    let name = checked_name(name)?;
    if param_text::has_factory(&name) {
        return Ok(name);
    }
    Err(Error::Usage(format!(
        "{name} has no value from the factory that this program knows; 'siskin params describe' \
         shows those that have"
    )))
}

/// Returns a file's settings, if all its lines parse.
fn read(file: &Path, complaints: &mut dyn Write) -> Result<Vec<Line>, Error> {
    let content = fs::read_to_string(file).map_err(|e| Error::file(file, e))?;
    param_file::read(&content).or_else(|bad| {
        for text in &bad {
            writeln!(complaints, "{}: {text}", file.display())?;
        }
        let bad = counted(bad.len(), "line");
        Err(Error::file(file, format!("{bad} bad; nothing was sent")))
    })
}

/// Formats as `1 line`, `2 lines`.
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

pub(crate) fn print(params: &[Param], json: bool, out: &mut dyn Write) -> Result<(), Error> {
    if json {
        let object: Map<String, Value> = params
            .iter()
            .map(|p| (p.name.clone(), number(p.value)))
            .collect();
        writeln!(out, "{}", Value::Object(object))?;
    } else {
        for Param { name, value } in params {
            let value = param_text::value(name, *value);
            writeln!(out, "{name:<width$} {value}", width = params::NAME_LENGTH)?;
        }
    }
    Ok(())
}

/// Prints what differs from the factory values.
fn diff_to_factory(params: &[Param], factory: &Factory, out: &mut dyn Write) -> Result<(), Error> {
    let pairs = params
        .iter()
        .filter_map(|param| Some((param, factory.value(&param.name)?)));
    diff(pairs, "from the factory", out)
}

/// Prints what differs from a file's settings, and which of these the ESC does not have.
fn diff_to_file(
    params: &[Param],
    file: &Path,
    lines: &[Line],
    out: &mut dyn Write,
) -> Result<(), Error> {
    let of = |line: &Line| params.iter().find(|param| param.name == line.param.name);
    let pairs = lines
        .iter()
        .filter_map(|line| Some((of(line)?, line.param.value)));
    diff(pairs, &format!("in {}", file.display()), out)?;
    for line in lines.iter().filter(|line| of(line).is_none()) {
        writeln!(out, "{}: the ESC has none", line.param.name)?;
    }
    Ok(())
}

fn diff<'a>(
    pairs: impl Iterator<Item = (&'a Param, f32)>,
    place: &str,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let mut differ = 0;
    for (Param { name, value }, other) in pairs.filter(|(param, other)| !same(param.value, *other))
    {
        let (width, other) = (params::NAME_LENGTH, param_text::value(name, other));
        let value = param_text::value(name, *value);
        writeln!(out, "{name:<width$} {value}, {place} {other}")?;
        differ += 1;
    }
    writeln!(out, "{differ} different")?;
    Ok(())
}

/// Returns those parameters that the ESC has, and the overall result; complains about each of the others.
fn get(
    session: &mut Session,
    names: &[String],
    complaints: &mut dyn Write,
) -> Result<(Vec<Param>, Result<(), Error>), Error> {
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
    let missing = names.len() - found.len();
    let ended = if missing > 0 {
        Err(Error::Partly(format!(
            "{missing} of {} not read",
            counted(names.len(), "parameter")
        )))
    } else {
        Ok(())
    };
    Ok((found, ended))
}

/// Sends each value; returns the number refused.
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
                let remedy = param_text::remedy(name, *value);
                writeln!(complaints, "{name} {value}: refused: {reason}{remedy}")?;
            }
        }
    }
    Ok(refused)
}

/// Stores if requested and if everything was accepted.
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
        params::storage(session, Storage::Write)?;
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
