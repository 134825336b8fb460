//! `siskin decode`: shows what a logic analyser has captured on a throttle wire.
//!
//! The capture is read from the beginning several times and never held in memory: once to find the channel
//! with edges, if none is given; once to detect the signal; and once to decode it, so that the first frames
//! are in the table too.

mod capture;
mod choose;
mod command;
mod detect;
mod measure;
mod reply;
mod row;
mod sampling;
mod spread;
mod summary;
mod table;
mod throttle;
mod track;
mod wire;

use std::fs::File;
use std::io::{self, BufRead, BufReader, BufWriter, Read, Seek, Write};
use std::path::Path;

use clap::Args;
use siskin_throttle::signal::Signal;

use crate::error::Error;
use capture::{Capture, Reason};
use choose::choose;
use detect::detect;
use sampling::Sampling;
use summary::Summary;
use table::Table;
use track::{Sighting, Tracker};
use wire::Wire;

/// Bytes of the file held in memory.
const BUFFER: usize = 1 << 16;

/// How long the line is assumed to rest after a capture, ns: long enough to end the last frame or reply,
/// and too short for a reply to count as missing.
const REST_NS: i64 = 25_000;

/// An edge on the wire.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Edge {
    at_ns: i64,
    /// The level from then on.
    level: bool,
}

/// How to decode.
#[derive(Clone, Debug, Default, Args)]
pub struct Options {
    /// Channel by name or by index from 0, instead of the only one with edges.
    #[arg(long, value_name = "NAME|INDEX")]
    pub channel: Option<String>,
    /// Signal by its INP_PROTO number or its name, for example 12 or DShot600, instead of detecting it.
    #[arg(long, value_name = "SIGNAL", value_parser = signal)]
    pub protocol: Option<Signal>,
    /// Print a line for each frame.
    #[arg(long)]
    pub all: bool,
    /// One JSON object a line; the last one is the summary.
    #[arg(long)]
    pub json: bool,
}

/// Why a capture was not decoded.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// Not a capture, no such channel, or no known signal; the message says what to do.
    #[error("{0}")]
    Capture(String),
    /// The table could not be written.
    #[error(transparent)]
    Output(#[from] io::Error),
}

impl From<Reason> for DecodeError {
    fn from(reason: Reason) -> Self {
        Self::Capture(reason)
    }
}

/// Decodes the file at this path.
///
/// # Errors
/// The file does not exist or is not a capture, lacks the channel, or has no known signal.
pub(crate) fn run(path: &Path, options: &Options, out: &mut dyn Write) -> Result<(), Error> {
    let done = File::open(path)
        .map_err(|error| DecodeError::Capture(error.to_string()))
        .and_then(|file| decode(file, options, out));
    done.map_err(|error| match error {
        DecodeError::Capture(reason) => Error::file(path, reason),
        DecodeError::Output(error) => Error::Output(error),
    })
}

/// Prints the table and summary of a capture, read from its beginning.
///
/// # Errors
/// The input is not a capture, lacks the channel or has no known signal, or `out` cannot be written.
pub fn decode(
    mut input: impl Read + Seek,
    options: &Options,
    out: &mut dyn Write,
) -> Result<(), DecodeError> {
    let channel = choose(open(&mut input)?, options.channel.as_deref())?;
    let signal = match options.protocol {
        Some(signal) => signal,
        None => detect(open(&mut input)?, channel)?,
    };
    let mut capture = open(&mut input)?;
    let mut table = Table::begin(signal, options, BufWriter::new(out))?;
    let mut summary = Summary::new(signal);
    let mut sampling = Sampling::new(capture.sample_hz());
    let mut wire = Wire::new(Some(signal));
    let mut tracker = Tracker::new(signal);
    let mut sightings = Vec::new();
    while let Some(edge) = next_edge(&mut capture, channel)? {
        sampling.edge(edge.at_ns);
        summary.edge(edge.at_ns);
        wire.edge(edge, &mut |item| tracker.take(item, &mut sightings));
        report(&mut sightings, &mut summary, &mut table)?;
    }
    wire.rest(capture.now_ns() + REST_NS, &mut |item| {
        tracker.take(item, &mut sightings);
    });
    tracker.finish(&mut sightings);
    report(&mut sightings, &mut summary, &mut table)?;
    table.finish(&summary, sampling.hz())?;
    Ok(())
}

/// Parses a signal argument.
fn signal(text: &str) -> Result<Signal, String> {
    let wanted = text.replace(['-', '_'], " ");
    let named = Signal::all().find(|signal| signal.name().eq_ignore_ascii_case(&wanted));
    let numbered = || text.parse().ok().and_then(Signal::from_number);
    named.or_else(numbered).ok_or_else(|| {
        let all: Vec<_> = Signal::all()
            .map(|signal| format!("{} {}", signal.number(), signal.name()))
            .collect();
        format!("give one of {}", all.join(", "))
    })
}

/// Counts and prints what has been seen.
fn report(
    sightings: &mut Vec<Sighting>,
    summary: &mut Summary,
    table: &mut Table<impl Write>,
) -> io::Result<()> {
    sightings.drain(..).try_for_each(|sighting| {
        summary.add(&sighting);
        table.add(sighting)
    })
}

fn next_edge(capture: &mut Capture<impl BufRead>, channel: usize) -> Result<Option<Edge>, Reason> {
    while let Some(change) = capture.next()? {
        if change.channel == channel {
            return Ok(Some(Edge {
                at_ns: change.at_ns,
                level: change.level,
            }));
        }
    }
    Ok(None)
}

/// Opens the capture at its beginning.
fn open<R: Read + Seek>(input: &mut R) -> Result<Capture<BufReader<&mut R>>, Reason> {
    input.rewind().map_err(|error| error.to_string())?;
    Capture::open(BufReader::with_capacity(BUFFER, input))
}
