//! A line of the table.

use serde_json::{Value, json};
use siskin_throttle::answer::extended::{DISABLED, ENABLED, Extended, Status};
use siskin_throttle::dshot::{Kind, check_mask, check_sum};
use siskin_throttle::signal::{Pulse, Signal};

use super::command;
use super::measure::Measured;
use super::reply::{Content, Reply};
use super::throttle::{self, Share};
use super::track::{Answer, Sighting, What};

/// The table's header.
pub(super) const HEAD: &str = "      time s   times  bits    what                            reply";

/// One sighting, or several equal ones in a row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    signal: Signal,
    first: Sighting,
    times: u64,
    /// Lowest and highest speed in its replies, eRPM.
    erpm: Option<(u32, u32)>,
}

impl Row {
    pub(super) fn new(signal: Signal, first: Sighting) -> Self {
        let erpm = first.what.erpm().map(|erpm| (erpm, erpm));
        Self {
            signal,
            first,
            times: 1,
            erpm,
        }
    }

    /// Merges a sighting that looks the same except for a speed; otherwise returns it.
    pub(super) fn join(&mut self, next: Sighting) -> Option<Sighting> {
        if !self.looks_like(&next.what) {
            return Some(next);
        }
        self.times += 1;
        if let (Some((least, most)), Some(erpm)) = (self.erpm, next.what.erpm()) {
            self.erpm = Some((least.min(erpm), most.max(erpm)));
        }
        None
    }

    fn looks_like(&self, next: &What) -> bool {
        match (&self.first.what, next) {
            (
                What::Frame { bits, answer, .. },
                What::Frame {
                    bits: next_bits,
                    answer: next_answer,
                    ..
                },
            ) => bits == next_bits && answer.looks_like(next_answer),
            (What::Pulse { width_ns }, What::Pulse { width_ns: next_ns }) => {
                width_ns.abs_diff(*next_ns) < throttle::step_ns(self.signal)
            }
            (What::Bad { .. }, What::Bad { .. }) => self.error() == error(self.signal, next),
            _ => false,
        }
    }

    /// Formats it as a line of text.
    pub(super) fn line(&self) -> String {
        let time_s = self.first.at_ns as f64 * 1e-9;
        let bits = match &self.first.what {
            What::Frame { bits, .. } => format!("0x{bits:04x}"),
            What::Bad {
                measured: Some(measured),
                ..
            } => format!("0x{:04x}", measured.bits),
            _ => String::new(),
        };
        let line = format!(
            "{time_s:>12.6} {:>7}  {bits:6}  {:30}  {}",
            self.times,
            self.what(),
            self.reply()
        );
        line.trim_end().to_owned()
    }

    /// Converts it to a JSON object.
    pub(super) fn json(&self) -> Value {
        let (mut bits, mut value, mut telemetry, mut name, mut width_us) =
            (None, None, None, None, None);
        let mut reply = Value::Null;
        match &self.first.what {
            What::Frame {
                frame,
                bits: sent,
                answer,
                ..
            } => {
                bits = Some(*sent);
                value = Some(frame.value);
                telemetry = Some(frame.telemetry);
                name = command_of(frame.kind(false)).map(command_text);
                reply = answer.json();
                if let Some((least, most)) = self.erpm {
                    reply["erpm_min"] = least.into();
                    reply["erpm_max"] = most.into();
                }
            }
            What::Pulse { width_ns } => width_us = Some(f64::from(*width_ns) / 1000.0),
            What::Bad { measured, .. } => bits = measured.as_ref().map(|measured| measured.bits),
        }
        json!({
            "time_s": self.first.at_ns as f64 / 1e9,
            "times": self.times,
            "bits": bits,
            "value": value,
            "telemetry": telemetry,
            "command": name,
            "width_us": width_us,
            "throttle": throttle::of(self.signal, &self.first.what).share(),
            "reply": reply,
            "error": self.error(),
        })
    }

    fn what(&self) -> String {
        match &self.first.what {
            What::Frame { frame, .. } => {
                let mut text = match command_of(frame.kind(false)) {
                    Some(command) => command_text(command),
                    None => format!("{} {}", frame.value, self.throttle()),
                };
                if frame.telemetry {
                    text += ", telemetry";
                }
                text
            }
            What::Pulse { width_ns } => {
                format!(
                    "{:.2} us {}",
                    f64::from(*width_ns) / 1000.0,
                    self.throttle()
                )
            }
            What::Bad { .. } => format!("bad: {}", self.error().unwrap_or_default()),
        }
    }

    fn throttle(&self) -> String {
        match throttle::of(self.signal, &self.first.what) {
            Share::Throttle(share) => format!("throttle {:.1} %", share * 100.0),
            Share::Zero => "zero".to_owned(),
            Share::None => String::new(),
        }
    }

    fn reply(&self) -> String {
        match (&self.first.what, self.erpm) {
            (_, Some((least, most))) if least < most => format!("{least} to {most} eRPM"),
            (What::Frame { answer, .. }, _) => answer.text(),
            _ => String::new(),
        }
    }

    fn error(&self) -> Option<String> {
        error(self.signal, &self.first.what)
    }
}

/// Returns what is wrong with the sighting.
fn error(signal: Signal, what: &What) -> Option<String> {
    let What::Bad { edges, measured } = what else {
        return None;
    };
    Some(match (signal, measured) {
        (Signal::Dshot { bidirectional, .. }, Some(measured)) => {
            frame_error(measured, bidirectional)
        }
        (Signal::Dshot { .. }, None) => format!("{edges} edges, no frame"),
        (Signal::Pulse(kind), _) => format!("no {} pulse", pulse_name(kind)),
    })
}

fn frame_error(measured: &Measured, bidirectional: bool) -> String {
    let sum_on = |bidirectional| check_sum(measured.bits >> 4) ^ check_mask(bidirectional);
    let (sum, other) = (sum_on(bidirectional), sum_on(!bidirectional));
    match measured.bits & 0xF {
        sent if sent == sum => format!("a bit takes {:.2} us", measured.bit_ns / 1000.0),
        sent if sent == other => "inverted check sum".to_owned(),
        sent => format!("check sum {sent:x}, not {sum:x}"),
    }
}

fn pulse_name(kind: Pulse) -> &'static str {
    Signal::Pulse(kind).name()
}

fn command_of(kind: Kind) -> Option<u16> {
    match kind {
        Kind::Stop => Some(0),
        Kind::Command(command) => Some(command.into()),
        Kind::Throttle(_) => None,
    }
}

/// Returns a command's number and name.
pub(super) fn command_text(command: u16) -> String {
    format!(
        "{command} {}",
        command::name(command).unwrap_or("unassigned")
    )
}

impl What {
    /// Returns the speed in a frame's reply.
    fn erpm(&self) -> Option<u32> {
        match self {
            Self::Frame {
                answer: Answer::Reply(reply),
                ..
            } => reply.erpm(),
            _ => None,
        }
    }
}

impl Answer {
    fn looks_like(&self, next: &Self) -> bool {
        match (self, next) {
            (Self::Reply(reply), Self::Reply(next)) => {
                reply.bits == next.bits || reply.erpm().is_some() && next.erpm().is_some()
            }
            // The capture ended before the reply could come.
            (_, Self::Unknown) => true,
            _ => self == next,
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Unknown => String::new(),
            Self::Missing => "none".to_owned(),
            Self::Reply(reply) => reply.text(),
        }
    }

    fn json(&self) -> Value {
        match self {
            Self::Unknown => Value::Null,
            Self::Missing => json!({ "error": "none" }),
            Self::Reply(reply) => reply.json(),
        }
    }
}

impl Reply {
    fn erpm(&self) -> Option<u32> {
        match self.content() {
            Some(Content::Erpm(erpm)) => Some(erpm),
            _ => None,
        }
    }

    fn text(&self) -> String {
        match self.content() {
            None => format!("bad: 0x{:06x}", self.bits),
            Some(Content::Erpm(erpm)) => format!("{erpm} eRPM"),
            Some(Content::Extended(word)) => extended_text(word),
        }
    }

    fn json(&self) -> Value {
        let content = self.content();
        let extended = match content {
            Some(Content::Extended(word)) => Some(extended_text(word)),
            _ => None,
        };
        json!({
            "delay_us": self.delay_ns as f64 / 1000.0,
            "bits": self.bits,
            "data": self.data(),
            "erpm": self.erpm(),
            "extended": extended,
            "error": content.is_none().then_some("check sum"),
        })
    }
}

fn extended_text(word: Extended) -> String {
    match word {
        ENABLED => "extended telemetry is on".to_owned(),
        DISABLED => "extended telemetry is off".to_owned(),
        Extended::Temperature(c) => format!("{c} \u{b0}C"),
        Extended::Voltage(quarters) => format!("{:.2} V", f64::from(quarters) / 4.0),
        Extended::Current(a) => format!("{a} A"),
        Extended::Debug1(value) => format!("debug 1: {value}"),
        Extended::Debug2(value) => format!("debug 2: {value}"),
        Extended::Stress(level) => format!("stress {level}"),
        Extended::Status(value) => {
            let status = Status::from_value(value);
            let flags = [
                (status.alert, ", alert"),
                (status.warning, ", warning"),
                (status.error, ", error"),
            ];
            let set: String = flags
                .into_iter()
                .filter_map(|(set, name)| set.then_some(name))
                .collect();
            format!("status: most stress {}{set}", status.max_stress)
        }
    }
}
