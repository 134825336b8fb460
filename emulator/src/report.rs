//! What is printed: the first screen, figures, verdicts. Each goes to standard output in one write, so that a closed
//! pipe is one clean error.

use std::fmt::Write as _;
use std::io::{self, Write as _};

use serde::Serialize;
use siskin_params::{ParamId, Params};
use siskin_scope::printable;

use crate::bench::DEFAULT_MOTOR;
use crate::interrupt;
use crate::link::Endpoint;
use crate::live::Opened;
use crate::options::{RunArgs, Speed};
use crate::scenario::{Outcome, Standing, Survey, Verdict};
use crate::summary::Report;

/// Writes text to standard output. A reader that has gone is no error: it has what it wanted.
///
/// # Errors
/// Standard output cannot be written.
pub fn print(text: &str) -> Result<(), String> {
    let mut out = io::stdout().lock();
    let written = interrupt::writing(|| out.write_all(text.as_bytes()).and_then(|()| out.flush()));
    match written {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(format!("standard output cannot be written: {error}"))
        }
        _ => Ok(()),
    }
}

/// Formats a value as one JSON object on a line.
///
/// # Errors
/// The value cannot be represented.
pub fn json(value: &impl Serialize) -> Result<String, String> {
    let text = serde_json::to_string(value).map_err(|error| error.to_string())?;
    Ok(text + "\n")
}

/// Prints the first screen of an open session, or one JSON object with every port. The ESC runs even if nobody reads
/// it.
pub fn opened(what: &str, args: &RunArgs, standing: &Standing, opened: &Opened, params: &Params) {
    let text = if !args.common.json {
        greeting(what, args, standing, opened, params)
    } else if !opened.endpoints.is_empty() || args.speed == Speed::Lockstep {
        json(&Ready::of(opened)).unwrap_or_default()
    } else {
        // If no link was asked for, only the summary is read.
        return;
    };
    let _ = print(&text);
}

/// The first line of JSON.
#[derive(Serialize)]
struct Ready {
    ready: Ports,
}

/// Where everything is reached.
#[derive(Serialize)]
struct Ports {
    /// MAVLink, as `--mavlink` has it.
    mavlink: Vec<String>,
    /// The throttle wire of the only or the first ESC, as `--signal` has it.
    signal: Option<String>,
    /// The page, as `--web` has it.
    web: Option<String>,
    /// One per ESC, if there are several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    escs: Vec<Port>,
}

/// Where an ESC is reached.
#[derive(Serialize)]
struct Port {
    signal: String,
}

impl Ready {
    fn of(opened: &Opened) -> Self {
        let signals = opened.signals.iter();
        let mut signals = signals.map(|address| format!("udp:{address}"));
        let signal = signals.clone().next();
        let escs = if opened.signals.len() > 1 {
            signals.by_ref().map(|signal| Port { signal }).collect()
        } else {
            Vec::new()
        };
        Self {
            ready: Ports {
                mavlink: opened.endpoints.iter().map(Endpoint::to_string).collect(),
                signal,
                web: opened.page.as_ref().map(|(at, _)| at.to_string()),
                escs,
            },
        }
    }
}

/// Returns the first screen: `what` runs, where it is reached, what to type next. `params` are in force.
fn greeting(
    what: &str,
    args: &RunArgs,
    standing: &Standing,
    opened: &Opened,
    params: &Params,
) -> String {
    let [motor, load] = &standing.names;
    let param = |id| params.get(id);
    let mut lines = vec![
        format!("Siskin ESC {}, {what}", env!("CARGO_PKG_VERSION")),
        String::new(),
        format!("  motor     {motor}"),
        format!("  load      {load}"),
        format!(
            "  supply    {:.1} V, PWM and control at {:.0} Hz, seed {}",
            standing.bench.supply.open_v(0.0),
            param(ParamId::PwmFreqHz),
            args.seed
        ),
    ];
    lines.extend(
        opened
            .links
            .iter()
            .map(|link| format!("  MAVLink   {link}")),
    );
    lines.extend(
        opened
            .signals
            .iter()
            .map(|address| format!("  throttle  udp:{address}, a datagram a frame")),
    );
    if let Some((_, url)) = &opened.page {
        lines.push(format!("  scope     {url} in a browser"));
    }
    if args
        .motor
        .as_ref()
        .is_some_and(|name| name != DEFAULT_MOTOR)
    {
        lines.push("  The ESC's MOT_ parameters are not set by --motor: use --param.".to_owned());
    }
    lines.push(String::new());
    if let Some(connect) = connect(&opened.endpoints) {
        lines.push("Next, in another terminal:".to_owned());
        let siskin = format!("  cargo run --release -p siskin --{connect}");
        lines.push(format!("{siskin} params list"));
        lines.push(format!("{siskin} monitor"));
    }
    lines.push(format!(
        "Zero throttle for {:.0} ms arms; then throttle turns the motor.",
        param(ParamId::InpArmMs)
    ));
    lines.push("README.md has a script that does so. Ctrl-C ends.".to_owned());
    printable::lines(&(lines.join("\n") + "\n"))
}

/// Returns the option with which `siskin` reaches one of these, servers first; empty for the one that it finds by
/// itself.
fn connect(endpoints: &[Endpoint]) -> Option<String> {
    let usual = Endpoint::defaults();
    let is_server = |endpoint: &&Endpoint| matches!(endpoint, Endpoint::TcpIn(_));
    if endpoints.iter().any(|e| is_server(&e) && usual.contains(e)) {
        return Some(String::new());
    }
    let servers = endpoints.iter().filter(is_server);
    let mut all = servers.chain(endpoints);
    let other = all.find_map(Endpoint::opposite)?;
    Some(format!(" --connect {other}"))
}

/// Formats the figures of a run.
pub fn figures(report: &Report) -> String {
    let pace = report.sim_per_wall.unwrap_or_default();
    let mut text = format!(
        "{:.3} s simulated in {:.3} s ({pace:.1} times real time), {} control periods, trace {}\n",
        report.sim_s, report.wall_s, report.steps, report.trace_hash
    );
    for (index, esc) in report.escs.iter().enumerate() {
        line(&mut text, format_args!("ESC {index}:"));
        text.push_str(&figures(esc));
    }
    for fault in report.faults.iter().flatten() {
        line(&mut text, format_args!("fault: {fault}"));
    }
    for warning in &report.warnings {
        line(&mut text, format_args!("warning: {warning}"));
    }
    if let Some(refused) = report.rejected {
        line(
            &mut text,
            format_args!(
                "refused: {} datagrams and {} frames on the wire, {} MAVLink frames",
                refused.wire_datagrams, refused.wire_frames, refused.mavlink_frames
            ),
        );
    }
    for window in &report.windows {
        let show = |value: Option<f64>, digits| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.digits$}"))
        };
        line(
            &mut text,
            format_args!(
                "{}: {} rpm, angle error {}° mean {}° max, torque {} Nm, i_q {} A, bus {} A",
                window.name,
                show(window.rpm_mean, 1),
                show(window.angle_error_mean_deg, 2),
                show(window.angle_error_max_deg, 2),
                show(window.torque_mean_nm, 4),
                show(window.i_q_mean_a, 2),
                show(window.bus_a_mean, 2),
            ),
        );
    }
    printable::lines(&text)
}

/// Formats whether a scenario's expectations held.
pub fn verdicts(outcome: &Outcome) -> String {
    let mut text = String::new();
    if outcome.interrupted {
        text.push_str("interrupted: what was played until then\n");
    }
    for (key, value) in &outcome.drawn {
        line(&mut text, format_args!("drawn: {key} = {value}"));
    }
    for verdict in &outcome.expectations {
        match verdict.held {
            Some(held) => {
                let held = if held { "held" } else { "FAILED" };
                line(&mut text, format_args!("{held}: {}", verdict.sentence()));
            }
            None => line(
                &mut text,
                format_args!(
                    "not seen: {}.{}, wanted {}",
                    verdict.window, verdict.key, verdict.wanted
                ),
            ),
        }
    }
    printable::lines(&text)
}

/// Formats the results of many runs.
pub fn survey(survey: &Survey) -> String {
    let pace = survey.sim_per_wall.unwrap_or_default();
    let mut text = format!(
        "{} runs, {} failed; {:.1} s simulated in {:.2} s ({pace:.1} times real \
         time), {} control periods, traces {}\n",
        survey.runs, survey.failed, survey.sim_s, survey.wall_s, survey.steps, survey.trace_hash
    );
    if survey.left_out > 0 {
        line(
            &mut text,
            format_args!("interrupted: {} runs left out", survey.left_out),
        );
    }
    for refusal in &survey.refusals {
        line(
            &mut text,
            format_args!("refused: {}: {}", refusal.options, refusal.error),
        );
    }
    let more = survey.refused - survey.refusals.len();
    if more > 0 {
        line(&mut text, format_args!("refused: {more} more"));
    }
    for (fault, runs) in &survey.faults {
        line(&mut text, format_args!("fault in {runs}: {fault}"));
    }
    for (warning, runs) in &survey.warnings {
        line(&mut text, format_args!("warning in {runs}: {warning}"));
    }
    for failure in &survey.failures {
        let broken: Vec<_> = failure.expectations.iter().map(Verdict::sentence).collect();
        line(
            &mut text,
            format_args!("failed: {}: {}", failure.options, broken.join("; ")),
        );
    }
    let more = survey.failed - survey.failures.len();
    if more > 0 {
        line(&mut text, format_args!("failed: {more} more"));
    }
    for expected in &survey.expectations {
        let held = match expected.failed {
            0 => "held".to_owned(),
            failed => format!("FAILED in {failed}"),
        };
        line(
            &mut text,
            format_args!(
                "{held}: {}.{} is at worst {}, wanted {}, with {}",
                expected.window,
                expected.key,
                number(expected.worst),
                expected.wanted,
                expected.options
            ),
        );
    }
    printable::lines(&text)
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "no data".to_owned(), |value| value.to_string())
}

fn line(text: &mut String, arguments: std::fmt::Arguments) {
    // Writing to a String cannot fail.
    let _ = writeln!(text, "{arguments}");
}
