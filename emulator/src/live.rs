//! An ESC in real time, on its MAVLink links and its throttle wire.
//!
//! One thread: it wakes each millisecond, takes in what has come on the sockets, simulates up to
//! the present and sends. An answer leaves within two milliseconds.

mod keeping;
mod pace;

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Duration;

use siskin_control::params::ParamId;
use thiserror::Error;

use crate::device::{Start, StartError};
use crate::fault::Fault;
use crate::flash::FileFlash;
use crate::interrupt;
use crate::link::{Endpoint, Event, LinkError, Links};
use crate::machine::{Machine, Stopped};
use crate::record::Recorder;
use crate::rig::Bench;
use crate::summary::Report;
use crate::watch::{Watch, WatchError};
use crate::wire::{SignalAddress, Wire, WireError};
use keeping::Keeping;
pub use pace::Pace;
use pace::Pacer;

/// What to run.
pub struct Session {
    /// What stands on the bench.
    pub bench: Bench,
    /// MAVLink endpoints.
    pub mavlink: Vec<Endpoint>,
    /// The throttle wire.
    pub signal: SignalAddress,
    /// How fast.
    pub pace: Pace,
    /// For how long, simulated.
    pub duration: Option<Duration>,
    /// Where parameters are kept.
    pub flash: FileFlash,
    /// Parameters over the stored ones.
    pub params: Vec<(ParamId, f32)>,
    /// Parameters in place of the factory's values.
    pub defaults: Vec<(ParamId, f32)>,
    /// What goes wrong.
    pub faults: Vec<Fault>,
    /// Where each period is written.
    pub record: Option<PathBuf>,
}

/// Why a session cannot run or go on; one line.
#[derive(Debug, Error)]
pub enum LiveError {
    /// A MAVLink endpoint.
    #[error("{0}")]
    Link(#[from] LinkError),
    /// The throttle wire.
    #[error("{0}")]
    Wire(#[from] WireError),
    /// The ESC does not start.
    #[error("{0}")]
    Start(#[from] StartError),
    /// The ESC cannot start or go on, for a reason of its own.
    #[error("{0}")]
    Stopped(#[from] Stopped),
    /// The plant or the recording.
    #[error("{0}")]
    Watch(#[from] WatchError),
    /// The system's signals cannot be caught.
    #[error("cannot listen for interrupts: {0}")]
    Interrupt(std::io::Error),
}

/// What a person should know of a session that has begun.
pub struct Opened {
    /// A line on each MAVLink link.
    pub links: Vec<String>,
    /// The MAVLink endpoints as they came to be.
    pub endpoints: Vec<Endpoint>,
    /// Where the throttle wire listens.
    pub signal: Option<std::net::SocketAddr>,
}

/// Runs a session until its duration or an interrupt: on what `start` makes, with a warning where what
/// was stored is not whole. Tells `opened` once all is open, and `warn` in a line what a person should know
/// then or later; gives back what it was at the end.
///
/// # Errors
/// The session cannot begin or go on.
pub fn run<M: Machine>(
    session: Session,
    start: impl FnOnce(Start) -> Result<(M, Option<&'static str>), LiveError>,
    opened: impl FnOnce(&Opened, &M),
    warn: impl Fn(&str),
) -> Result<(Report, M), LiveError> {
    let stop = interrupt::flag().map_err(LiveError::Interrupt)?;
    let mut links = Links::open(&session.mavlink)?;
    let wire = Wire::open(&session.signal, 0)?;
    let signal = wire.local_address();
    let end_s = session.duration.map(|duration| duration.as_secs_f64());
    let window = ("all".to_owned(), 0.0, end_s.unwrap_or(f64::MAX));
    let recorder = session.record.as_deref().map(Recorder::live).transpose();
    let mut watch = Watch::new([window], recorder.map_err(WatchError::Record)?);
    let link_bytes_per_s = links.slowest_bytes_per_s();
    let (mut machine, warning) = start(Start {
        bench: session.bench,
        wire,
        flash: session.flash,
        overrides: session.params,
        defaults: session.defaults,
        faults: session.faults,
        link_bytes_per_s,
    })?;
    let about = Opened {
        links: links.describe(),
        endpoints: links.endpoints(),
        signal,
    };
    if let Some(warning) = warning {
        warn(warning);
    }
    opened(&about, &machine);

    let mut pacer = Pacer::new(session.pace);
    let mut keeping = Keeping::new(session.pace);
    let end_ns = session.duration.map_or(u64::MAX, |d| d.as_nanos() as u64);
    while !stop.load(Ordering::Relaxed) && machine.is_before(end_ns) && !watch.failed() {
        let now = pacer.began.elapsed();
        links.receive(now, |stream, event| match event {
            Event::Bytes(bytes) => machine.receive(stream, bytes, &mut watch),
            Event::Ended => machine.forget(stream),
        });
        let now_ns = machine.now_ns();
        machine.wire().poll(now_ns);
        let until_ns = pacer.until_ns(now_ns).min(end_ns);
        let advanced = machine.advance(until_ns, &mut watch, &mut |frame| {
            // A peer without room loses the frame, as on any datagram link.
            links.send(frame);
        });
        if let Err(stopped) = advanced {
            // The recording of what led there is worth having.
            watch.finish(0.0, 0.0)?;
            return Err(stopped.into());
        }
        pacer.wait(machine.now_ns());
        let played = machine.wire().counts().played;
        if let Some(line) = keeping.look(pacer.began.elapsed(), machine.now_ns(), played) {
            warn(&line);
        }
    }
    let sim_s = machine.now_ns() as f64 * 1e-9;
    let report = Report {
        rejected: Some(machine.rejected()),
        ..watch.finish(sim_s, pacer.began.elapsed().as_secs_f64())?
    };
    Ok((report, machine))
}
