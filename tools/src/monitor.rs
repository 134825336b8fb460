//! Live telemetry.

use std::collections::BTreeMap;
use std::io::{self, IsTerminal, Write};
use std::time::{Duration, Instant};

use mavlink::dialects::ardupilotmega::{MavSeverity, NAMED_VALUE_FLOAT_DATA};
use serde_json::{Value, json};
use siskin_control::mavlink::Address;
use siskin_control::telemetry::SIGNALS;

use crate::cli::MonitorArgs;
use crate::error::Error;
use crate::json::{fixed, number};
use crate::message::{Message, StatusText, name_of, text};
use crate::sample::Source;
use crate::session::Session;

/// Silence after which the user is told. `ESC_STATUS` comes at least once a second.
const SILENCE: Duration = Duration::from_secs(5);

/// Interval of our own heartbeat, without which some links forget us.
const GREETING_PERIOD: Duration = Duration::from_secs(1);

/// Shows telemetry until `--count` samples have come, or forever.
///
/// # Errors
/// [`Error::Silent`] if samples are counted and none come; any error of the link.
pub(crate) fn run(
    session: &mut Session,
    args: &MonitorArgs,
    out: &mut dyn Write,
    complaints: &mut dyn Write,
) -> Result<(), Error> {
    let mut view = View::default();
    let mut screen = Screen {
        in_place: !args.json && io::stdout().is_terminal(),
        shown: 0,
    };
    let mut samples = 0;
    let mut heard = Instant::now();
    let mut greeted = Instant::now();
    while args.count.is_none_or(|count| samples < count) {
        if greeted.elapsed() >= GREETING_PERIOD {
            session.greet()?;
            greeted = Instant::now();
        }
        if heard.elapsed() >= SILENCE {
            let silent = Error::Silent {
                what: format!("telemetry of {}", name_of(session.target())),
                seconds: SILENCE.as_secs(),
            };
            if args.count.is_some() {
                return Err(silent);
            }
            screen.clear(out)?;
            writeln!(complaints, "{silent}")?;
            heard = Instant::now();
        }
        // If a link has several ESCs, one of them sends the telemetry of all: listen to every component of
        // the system.
        let Some(incoming) = session.next(Instant::now() + GREETING_PERIOD)? else {
            continue;
        };
        let Address { system, component } = incoming.from;
        if system != session.target().system {
            continue;
        }
        match incoming.message {
            Message::EscInfo(info) => {
                let source = view.source(component, info.index);
                source.info = Some(info);
            }
            Message::EscTelemetry(telemetry) => {
                view.source(component, telemetry.index).telemetry = Some(telemetry.data);
            }
            Message::Named(signal) => {
                let name = text(&signal.name);
                // The share of bad frames, which comes unrequested, is not shown.
                let Some(number) = SIGNALS.iter().position(|signal| *signal == name) else {
                    continue;
                };
                if args.json {
                    writeln!(out, "{}", signal_json(component, &signal))?;
                } else {
                    view.latest.insert(
                        Line::Signal(component, number),
                        format!("      {name:<10} {:>12}", fixed(signal.value, 4)),
                    );
                }
            }
            Message::StatusText(status) if args.json => {
                writeln!(out, "{}", status_json(&status))?;
            }
            Message::StatusText(status) => {
                screen.clear(out)?;
                writeln!(out, "{}: {}", severity(&status), status.text)?;
            }
            Message::EscStatus(status) => {
                heard = Instant::now();
                samples += 1;
                let rows = view.source(component, status.index).rows(&status);
                if args.json {
                    for row in &rows {
                        writeln!(out, "{}", row.json())?;
                    }
                } else {
                    view.latest
                        .extend(rows.iter().map(|row| (Line::Esc(row.esc), row.line())));
                    screen.show(out, &view.latest)?;
                    // A terminal keeps what other components sent; a pipe gets each sample once.
                    if !screen.in_place {
                        view.latest.clear();
                    }
                }
            }
            _ => {}
        }
        out.flush()?;
    }
    Ok(())
}

/// What is known about all ESCs of the system.
#[derive(Default)]
struct View {
    /// By component and `index`, the number of a message's first ESC.
    sources: BTreeMap<(u8, u8), Source>,
    /// The rows to show.
    latest: BTreeMap<Line, String>,
}

/// What a row is about, in display order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Line {
    /// An ESC, by its number.
    Esc(usize),
    /// A signal of a component's control, by its bit in `TEL_SIGNALS`.
    Signal(u8, usize),
}

impl View {
    fn source(&mut self, component: u8, index: u8) -> &mut Source {
        self.sources.entry((component, index)).or_default()
    }
}

fn severity(status: &StatusText) -> &'static str {
    match status.severity {
        MavSeverity::MAV_SEVERITY_EMERGENCY => "emergency",
        MavSeverity::MAV_SEVERITY_ALERT => "alert",
        MavSeverity::MAV_SEVERITY_CRITICAL => "critical",
        MavSeverity::MAV_SEVERITY_ERROR => "error",
        MavSeverity::MAV_SEVERITY_WARNING => "warning",
        MavSeverity::MAV_SEVERITY_NOTICE => "notice",
        MavSeverity::MAV_SEVERITY_INFO => "info",
        MavSeverity::MAV_SEVERITY_DEBUG => "debug",
    }
}

fn signal_json(component: u8, signal: &NAMED_VALUE_FLOAT_DATA) -> Value {
    json!({
        "component": component,
        "time_s": f64::from(signal.time_boot_ms) / 1e3,
        "signal": text(&signal.name),
        "value": number(signal.value),
    })
}

fn status_json(status: &StatusText) -> Value {
    json!({ "severity": severity(status), "text": status.text })
}

/// Lines that a terminal shows in place, and a pipe gets one after another.
struct Screen {
    in_place: bool,
    /// Lines above the cursor that are to be replaced.
    shown: usize,
}

impl Screen {
    /// Shows these rows in place of the previous ones.
    fn show(&mut self, out: &mut dyn Write, rows: &BTreeMap<Line, String>) -> io::Result<()> {
        self.clear(out)?;
        for row in rows.values() {
            writeln!(out, "{row}")?;
        }
        self.shown = if self.in_place { rows.len() } else { 0 };
        Ok(())
    }

    /// Removes the rows, so that what is printed next takes their place for good.
    fn clear(&mut self, out: &mut dyn Write) -> io::Result<()> {
        if self.shown > 0 {
            // Up by that many rows to the first column, and erase to the end of the screen.
            write!(out, "\x1b[{}F\x1b[J", self.shown)?;
            self.shown = 0;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_shows_rows_in_place_and_a_pipe_one_after_another() {
        let shown = |in_place| {
            let mut out = Vec::new();
            let mut screen = Screen { in_place, shown: 0 };
            for rows in [&["a"][..], &["b", "c"]] {
                let rows = rows.iter().map(|&row| row.to_owned()).enumerate();
                let rows = rows.map(|(esc, row)| (Line::Esc(esc), row)).collect();
                screen.show(&mut out, &rows).expect("memory");
            }
            screen.clear(&mut out).expect("memory");
            String::from_utf8(out).expect("text")
        };
        assert_eq!(shown(false), "a\nb\nc\n");
        assert_eq!(shown(true), "a\n\x1b[1F\x1b[Jb\nc\n\x1b[2F\x1b[J");
    }
}
