//! Summary of a capture: counts, rates and timing.

use std::collections::BTreeMap;
use std::io::{self, Write};

use serde_json::{Value, json};
use siskin_throttle::command::repeats;
use siskin_throttle::signal::Signal;

use super::command;
use super::measure::{Measured, rate_error_pct};
use super::row::command_text;
use super::spread::{Range, Spread, short};
use super::track::{Answer, Sighting, What};

/// A pause without frames or pulses that is worth reporting, ns: what an ESC takes for a lost signal.
const GAP_NS: i64 = 100_000_000;

/// Samples per bit below which timing says little: the fewest that the ESC's own timer may have.
const LEAST_SAMPLES: f64 = 12.0;

/// Counts and spreads of what has been seen.
pub(super) struct Summary {
    signal: Signal,
    /// The first and the last edge.
    span_ns: Option<(i64, i64)>,
    edges: u64,
    good: u64,
    bad: u64,
    telemetry: u64,
    last_ns: Option<i64>,
    interval_ns: Spread,
    gaps: Gaps,
    bit_ns: Spread,
    ones_pct: Spread,
    zeros_pct: Spread,
    stray_ns: Spread,
    width_us: Spread,
    replies: Replies,
    commands: Commands,
}

/// Pauses of more than 100 ms.
#[derive(Default)]
struct Gaps {
    count: u64,
    longest_ns: i64,
    longest_at_ns: i64,
}

/// What followed bidirectional frames.
#[derive(Default)]
struct Replies {
    good: u64,
    bad: u64,
    missing: u64,
    delay_us: Spread,
    rate_error_pct: Spread,
}

/// Commands, each with its count and its longest run.
#[derive(Default)]
struct Commands {
    seen: BTreeMap<u16, (u64, u32)>,
    /// The current command and the length of its run.
    run: Option<(u16, u32)>,
}

impl Summary {
    pub(super) fn new(signal: Signal) -> Self {
        Self {
            signal,
            span_ns: None,
            edges: 0,
            good: 0,
            bad: 0,
            telemetry: 0,
            last_ns: None,
            interval_ns: Spread::default(),
            gaps: Gaps::default(),
            bit_ns: Spread::default(),
            ones_pct: Spread::default(),
            zeros_pct: Spread::default(),
            stray_ns: Spread::default(),
            width_us: Spread::default(),
            replies: Replies::default(),
            commands: Commands::default(),
        }
    }

    pub(super) fn edge(&mut self, at_ns: i64) {
        self.edges += 1;
        let (first_ns, _) = *self.span_ns.get_or_insert((at_ns, at_ns));
        self.span_ns = Some((first_ns, at_ns));
    }

    fn seconds(&self) -> f64 {
        let (first_ns, last_ns) = self.span_ns.unwrap_or_default();
        (last_ns - first_ns) as f64 / 1e9
    }

    pub(super) fn add(&mut self, sighting: &Sighting) {
        match &sighting.what {
            What::Frame {
                frame,
                measured,
                answer,
                ..
            } => {
                self.good_at(sighting.at_ns);
                self.telemetry += u64::from(frame.telemetry);
                self.commands.add(frame.value);
                if let Some(measured) = measured {
                    self.timing(measured);
                }
                self.reply(answer);
            }
            What::Pulse { width_ns } => {
                self.good_at(sighting.at_ns);
                self.width_us.add(f64::from(*width_ns) / 1000.0);
            }
            What::Bad { .. } => {
                self.bad += 1;
                self.commands.run = None;
            }
        }
    }

    fn good_at(&mut self, at_ns: i64) {
        self.good += 1;
        let Some(last_ns) = self.last_ns.replace(at_ns) else {
            return;
        };
        let since_ns = at_ns - last_ns;
        if since_ns > GAP_NS {
            self.gaps.count += 1;
            if since_ns > self.gaps.longest_ns {
                (self.gaps.longest_ns, self.gaps.longest_at_ns) = (since_ns, last_ns);
            }
        } else if since_ns > 0 {
            self.interval_ns.add(since_ns as f64);
        }
    }

    fn timing(&mut self, measured: &Measured) {
        self.bit_ns.add(measured.bit_ns);
        for (bit, &share) in measured.shares.iter().enumerate() {
            let shares = if measured.bits << bit & 0x8000 != 0 {
                &mut self.ones_pct
            } else {
                &mut self.zeros_pct
            };
            shares.add(share * 100.0);
        }
        // The first and the last bit deviate by nothing: the mean bit time is taken from them.
        for stray_ns in &measured.strays_ns[1..15] {
            self.stray_ns.add(stray_ns.abs());
        }
    }

    fn reply(&mut self, answer: &Answer) {
        match answer {
            Answer::Unknown => {}
            Answer::Missing => self.replies.missing += 1,
            Answer::Reply(reply) => {
                let count = match reply.data() {
                    Some(_) => &mut self.replies.good,
                    None => &mut self.replies.bad,
                };
                *count += 1;
                self.replies.delay_us.add(reply.delay_ns as f64 / 1000.0);
                if let Signal::Dshot { rate, .. } = self.signal {
                    let frame_bit_ns = reply.bit_ns * 1.25;
                    let error_pct = rate_error_pct(frame_bit_ns, rate);
                    self.replies.rate_error_pct.add(error_pct);
                }
            }
        }
    }

    /// Returns what makes the figures doubtful.
    fn warning(&self, sample_hz: Option<f64>) -> Option<String> {
        let (Some(sample_hz), Signal::Dshot { rate, .. }) = (sample_hz, self.signal) else {
            return None;
        };
        let needed_hz = LEAST_SAMPLES * f64::from(rate.bit_hz());
        (sample_hz < needed_hz).then(|| {
            format!(
                "{} samples at {:.1} MHz are too coarse: bits may be misread and times are within \
                 {:.0} ns; sample at {:.1} MHz or more",
                self.signal.name(),
                sample_hz / 1e6,
                1e9 / sample_hz,
                needed_hz / 1e6
            )
        })
    }

    pub(super) fn print(&self, out: &mut dyn Write, sample_hz: Option<f64>) -> io::Result<()> {
        let name = match self.signal {
            Signal::Dshot { .. } => "frames",
            Signal::Pulse(_) => "pulses",
        };
        let kind = self.signal.name();
        let seconds = self.seconds();
        writeln!(
            out,
            "signal     {kind}, {} edges in {seconds:.6} s",
            self.edges
        )?;
        writeln!(out, "{name}     {} good, {} bad", self.good, self.bad)?;
        if let Some(rate_hz) = self.interval_ns.rate_hz() {
            writeln!(out, "rate       {} Hz", rate_hz.text(1))?;
        }
        if self.gaps.count > 0 {
            writeln!(
                out,
                "gaps       {} over 100 ms, the longest {:.3} s from {:.6} s on",
                self.gaps.count,
                self.gaps.longest_ns as f64 * 1e-9,
                self.gaps.longest_at_ns as f64 * 1e-9
            )?;
        }
        self.print_timing(out)?;
        self.print_replies(out)?;
        self.print_commands(out)?;
        match self.warning(sample_hz) {
            Some(warning) => writeln!(out, "warning    {warning}"),
            None => Ok(()),
        }
    }

    fn print_timing(&self, out: &mut dyn Write) -> io::Result<()> {
        if let Some(width_us) = self.width_us.range() {
            writeln!(out, "width      {} us", width_us.text(2))?;
        }
        let Signal::Dshot { rate, .. } = self.signal else {
            return Ok(());
        };
        if let Some(bit_ns) = self.bit_ns.range() {
            writeln!(
                out,
                "bit time   {} ns, the rate is {} % off",
                bit_ns.text(1),
                signed(rate_error_pct(self.bit_ns.mean(), rate))
            )?;
            writeln!(
                out,
                "jitter     {:.1} ns rms, {:.1} ns at most",
                self.stray_ns.rms(),
                self.stray_ns.most()
            )?;
        }
        for (name, shares) in [("ones ", &self.ones_pct), ("zeros", &self.zeros_pct)] {
            if let Some(shares) = shares.range() {
                writeln!(out, "{name}      {} % of a bit", shares.text(1))?;
            }
        }
        Ok(())
    }

    fn print_replies(&self, out: &mut dyn Write) -> io::Result<()> {
        let replies = &self.replies;
        if self.telemetry > 0 {
            writeln!(out, "telemetry  requested by {} frames", self.telemetry)?;
        }
        if replies.good + replies.bad + replies.missing == 0 {
            return Ok(());
        }
        writeln!(
            out,
            "replies    {} good, {} bad, {} missing",
            replies.good, replies.bad, replies.missing
        )?;
        if let Some(delay_us) = replies.delay_us.range() {
            writeln!(
                out,
                "           {} us after the frame, the rate is {} % off",
                delay_us.text(2),
                signed(replies.rate_error_pct.mean())
            )?;
        }
        Ok(())
    }

    fn print_commands(&self, out: &mut dyn Write) -> io::Result<()> {
        for (&command, &(count, in_a_row)) in &self.commands.seen {
            let few = match repeats(command) {
                Some(needed) if in_a_row < u32::from(needed) => {
                    format!(", too few: it takes {needed} in a row")
                }
                _ => String::new(),
            };
            writeln!(
                out,
                "command    {}: {count} frames, {in_a_row} in a row{few}",
                command_text(command)
            )?;
        }
        Ok(())
    }

    pub(super) fn json(&self, sample_hz: Option<f64>) -> Value {
        let commands: Vec<Value> = self.commands.seen.iter().map(command_json).collect();
        json!({ "summary": {
            "signal": self.signal.name(),
            "protocol": self.signal.number(),
            "seconds": self.seconds(),
            "edges": self.edges,
            "good": self.good,
            "bad": self.bad,
            "rate_hz": self.interval_ns.rate_hz().map(Range::json),
            "gaps": self.gaps.count,
            "longest_gap_s": (self.gaps.count > 0).then_some(self.gaps.longest_ns as f64 / 1e9),
            "bit_ns": self.bit_ns.range().map(Range::json),
            "jitter_rms_ns": (!self.stray_ns.is_empty()).then(|| short(self.stray_ns.rms())),
            "jitter_max_ns": (!self.stray_ns.is_empty()).then(|| short(self.stray_ns.most())),
            "ones_pct": self.ones_pct.range().map(Range::json),
            "zeros_pct": self.zeros_pct.range().map(Range::json),
            "width_us": self.width_us.range().map(Range::json),
            "telemetry": self.telemetry,
            "replies_good": self.replies.good,
            "replies_bad": self.replies.bad,
            "replies_missing": self.replies.missing,
            "reply_delay_us": self.replies.delay_us.range().map(Range::json),
            "commands": commands,
            "warning": self.warning(sample_hz),
        }})
    }
}

impl Commands {
    /// Adds the value of the next frame.
    fn add(&mut self, value: u16) {
        if !(1..48).contains(&value) {
            self.run = None;
            return;
        }
        let in_a_row = match self.run {
            Some((command, times)) if command == value => times.saturating_add(1),
            _ => 1,
        };
        self.run = Some((value, in_a_row));
        let (count, most) = self.seen.entry(value).or_default();
        *count += 1;
        *most = in_a_row.max(*most);
    }
}

/// Formats a number with its sign and two decimals; what rounds to zero gets a plus.
fn signed(number: f64) -> String {
    // Minus zero plus zero is zero.
    format!("{:+.2}", (number * 100.0).round() / 100.0 + 0.0)
}

fn command_json((&command, &(count, in_a_row)): (&u16, &(u64, u32))) -> Value {
    json!({
        "command": command,
        "name": command::name(command),
        "times": count,
        "in_a_row": in_a_row,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_that_rounds_to_nothing_has_one_sign() {
        let texts = [-0.004, -0.0, 0.004, -0.006, 3.0].map(signed);
        assert_eq!(texts, ["+0.00", "+0.00", "+0.00", "-0.01", "+3.00"]);
    }
}
