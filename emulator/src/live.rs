//! ESCs in real time, on their MAVLink links and throttle wires.
//!
//! A single thread wakes every millisecond, reads the sockets, simulates up to the present and sends. An answer leaves
//! within two milliseconds.

mod keeping;
mod pace;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use siskin_params::ParamId;
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
use crate::watch::{Watch, WatchError, Watches};
use crate::web::{Web, WebAddress, WebError};
use crate::wire::{SignalAddress, Wire, WireError};
use keeping::Keeping;
pub use pace::Pace;
use pace::Pacer;

/// What to run.
pub struct Session {
    /// The bench.
    pub bench: Bench,
    /// The names of its motor and load.
    pub names: [String; 2],
    /// MAVLink endpoints.
    pub mavlink: Vec<Endpoint>,
    /// The throttle wire.
    pub signal: SignalAddress,
    /// How fast.
    pub pace: Pace,
    /// Duration in simulated time.
    pub duration: Option<Duration>,
    /// Storage of each ESC's parameters: there are as many ESCs.
    pub flash: Vec<FileFlash>,
    /// Parameters that override the stored ones.
    pub params: Vec<(ParamId, f32)>,
    /// Parameters that replace the factory values.
    pub defaults: Vec<(ParamId, f32)>,
    /// The faults.
    pub faults: Vec<Fault>,
    /// Where each period is recorded; of several ESCs, each has its number before the extension.
    pub record: Option<PathBuf>,
    /// Where the page is served.
    pub web: WebAddress,
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
    /// The page.
    #[error("{0}")]
    Web(#[from] WebError),
    /// The plant or the recording.
    #[error("{0}")]
    Watch(#[from] WatchError),
    /// The system's signals cannot be caught.
    #[error("cannot listen for interrupts: {0}")]
    Interrupt(std::io::Error),
}

/// What the user should know about a session that has begun.
pub struct Opened {
    /// A line on each MAVLink link.
    pub links: Vec<String>,
    /// The actual MAVLink endpoints.
    pub endpoints: Vec<Endpoint>,
    /// Where the throttle wire of each ESC listens.
    pub signals: Vec<SocketAddr>,
    /// Where the page is served, and what the user opens.
    pub page: Option<(SocketAddr, String)>,
}

/// A session whose sockets and recordings are open.
pub(crate) struct Open {
    pub(crate) links: Links,
    pub(crate) watches: Watches,
    /// Set by an interrupt.
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) end_ns: u64,
    pub(crate) about: Opened,
    pub(crate) began: Instant,
}

impl Session {
    /// Returns where each ESC is recorded, if at all.
    fn recordings(&self) -> Vec<PathBuf> {
        let escs = self.flash.len();
        match &self.record {
            Some(path) if escs > 1 => (0..escs).map(|esc| numbered(path, esc)).collect(),
            path => path.iter().cloned().collect(),
        }
    }

    /// Opens what it needs; returns it with what the ESCs start with.
    ///
    /// # Errors
    /// The session cannot begin.
    pub(crate) fn open(self) -> Result<(Open, Vec<Start>), LiveError> {
        let stop = interrupt::flag().map_err(LiveError::Interrupt)?;
        let links = Links::open(&self.mavlink)?;
        let link_bytes_per_s = links.slowest_bytes_per_s();
        let end_s = self.duration.map_or(f64::MAX, |end| end.as_secs_f64());
        let mut about = Opened {
            links: links.describe(),
            endpoints: links.endpoints(),
            signals: Vec::new(),
            page: None,
        };
        let mut recordings = self.recordings().into_iter();
        let (mut watches, mut starts) = (Vec::new(), Vec::new());
        for (esc, flash) in self.flash.into_iter().enumerate() {
            let wire = Wire::open(&self.signal, esc as u16)?;
            about.signals.extend(wire.local_address());
            let path = recordings.next();
            let recorder = path.as_deref().map(Recorder::live).transpose();
            let window = ("all".to_owned(), 0.0, end_s);
            let recorder = recorder.map_err(WatchError::Record)?;
            watches.push(Watch::new([window], recorder));
            starts.push(Start {
                bench: self.bench.clone(),
                wire,
                flash,
                overrides: self.params.clone(),
                defaults: self.defaults.clone(),
                faults: self.faults.clone(),
                link_bytes_per_s,
            });
        }
        let open = Open {
            links,
            watches: Watches::new(watches),
            stop,
            end_ns: self.duration.map_or(u64::MAX, |end| end.as_nanos() as u64),
            about,
            began: Instant::now(),
        };
        Ok((open, starts))
    }
}

impl Open {
    /// Returns true while the session goes on.
    pub(crate) fn goes_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed) && !self.watches.failed()
    }

    /// Passes received MAVLink data to a machine.
    pub(crate) fn receive(&mut self, machine: &mut impl Machine) {
        let watches = &mut self.watches;
        self.links
            .receive(self.began.elapsed(), |stream, event| match event {
                Event::Bytes(bytes) => machine.receive(stream, bytes, watches),
                Event::Ended => machine.forget(stream),
            });
    }

    /// Computes the final figures.
    pub(crate) fn finish(self, machine: &impl Machine) -> Result<Report, WatchError> {
        let rejected: Vec<_> = (0..machine.escs())
            .map(|esc| machine.rejected(esc))
            .collect();
        let sim_s = machine.now_ns() as f64 * 1e-9;
        let report = self
            .watches
            .finish(sim_s, self.began.elapsed().as_secs_f64())?;
        Ok(report.with_rejected(&rejected))
    }
}

/// Returns the recording of one of several ESCs: its number before the extension, which sets the format.
fn numbered(path: &Path, esc: usize) -> PathBuf {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    path.with_extension(format!("{esc}.{extension}"))
}

/// Runs a session until its duration or an interrupt, on what `start` makes, which comes with a warning if stored data
/// is not intact. Calls `opened` once everything is open, and `warn` with a line that the user should know then or
/// later; returns the machine's final state.
///
/// # Errors
/// The session cannot begin or go on.
pub fn run<M: Machine>(
    session: Session,
    start: impl FnOnce(Vec<Start>) -> Result<(M, Vec<&'static str>), LiveError>,
    opened: impl FnOnce(&Opened, &M),
    warn: impl Fn(&str),
) -> Result<(Report, M), LiveError> {
    let pace = session.pace;
    let escs = session.flash.len();
    let stands = (&session.names, escs);
    let (mut web, no_page) = Web::open(&session.web, stands, &session.recordings())?;
    let (mut open, starts) = session.open()?;
    open.about.page = web.as_ref().map(Web::place);
    let (mut machine, warnings) = start(starts)?;
    warnings
        .into_iter()
        .chain(no_page.as_deref())
        .for_each(&warn);
    opened(&open.about, &machine);

    let mut pacer = Pacer::new(pace);
    let mut keeping = Keeping::new(pace);
    while open.goes_on() && machine.is_before(open.end_ns) {
        open.receive(&mut machine);
        let now_ns = machine.now_ns();
        for esc in 0..machine.escs() {
            machine.wire(esc).poll(now_ns);
        }
        if let Some(web) = &mut web {
            web.receive(&mut open.links, &mut machine, &mut open.watches);
        }
        let until_ns = pacer.until_ns(now_ns).min(open.end_ns);
        let links = &mut open.links;
        let mut to_pages = Vec::new();
        let mut onlooker = Web::tapped(web.as_mut(), &mut open.watches);
        let advanced = machine.advance(until_ns, &mut onlooker, &mut |frame| {
            // A peer without room loses the frame, as on any datagram link.
            links.send(frame);
            to_pages.extend_from_slice(frame);
        });
        if let Some(web) = &web {
            web.send(&to_pages);
        }
        if let Err(stopped) = advanced {
            // A recording of what led there is worth having.
            open.watches.finish(0.0, 0.0)?;
            return Err(stopped.into());
        }
        pacer.wait(machine.now_ns());
        let played = (0..machine.escs()).map(|esc| machine.wire(esc).counts().played);
        // One sender sends to all of them.
        let played = played.max().unwrap_or(0);
        if let Some(line) = keeping.look(pacer.began.elapsed(), machine.now_ns(), played) {
            warn(&line);
        }
    }
    let report = open.finish(&machine)?;
    Ok((report, machine))
}
