//! ESCs in real time, on their MAVLink links and their throttle wires.
//!
//! One thread: it wakes each millisecond, takes in what has come on the sockets, simulates up to
//! the present and sends. An answer leaves within two milliseconds.

mod keeping;
mod pace;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

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
use crate::watch::{Watch, WatchError, Watches};
use crate::web::{Web, WebAddress, WebError};
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
    /// Where the parameters of each ESC are kept: there are as many ESCs.
    pub flash: Vec<FileFlash>,
    /// Parameters over the stored ones.
    pub params: Vec<(ParamId, f32)>,
    /// Parameters in place of the factory's values.
    pub defaults: Vec<(ParamId, f32)>,
    /// What goes wrong.
    pub faults: Vec<Fault>,
    /// Where each period is written; each of several ESCs has its number before the extension.
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

/// What a person should know of a session that has begun.
pub struct Opened {
    /// A line on each MAVLink link.
    pub links: Vec<String>,
    /// The MAVLink endpoints as they came to be.
    pub endpoints: Vec<Endpoint>,
    /// Where the throttle wire of each ESC listens.
    pub signals: Vec<SocketAddr>,
    /// Where the page is served, and what a person opens.
    pub page: Option<(SocketAddr, String)>,
}

/// A session whose sockets and recordings are open.
pub(crate) struct Open {
    pub(crate) links: Links,
    pub(crate) watches: Watches,
    /// An interrupt has come.
    pub(crate) stop: Arc<AtomicBool>,
    pub(crate) end_ns: u64,
    pub(crate) about: Opened,
    pub(crate) began: Instant,
}

impl Session {
    /// Where each ESC is recorded, if it is.
    fn recordings(&self) -> Vec<PathBuf> {
        let escs = self.flash.len();
        match &self.record {
            Some(path) if escs > 1 => (0..escs).map(|esc| numbered(path, esc)).collect(),
            path => path.iter().cloned().collect(),
        }
    }

    /// Opens what it needs; gives it with what the ESCs start with.
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
    /// Whether the session goes on.
    pub(crate) fn goes_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed) && !self.watches.failed()
    }

    /// Hands what has come by MAVLink to a machine.
    pub(crate) fn receive(&mut self, machine: &mut impl Machine) {
        let watches = &mut self.watches;
        self.links
            .receive(self.began.elapsed(), |stream, event| match event {
                Event::Bytes(bytes) => machine.receive(stream, bytes, watches),
                Event::Ended => machine.forget(stream),
            });
    }

    /// The figures at the end.
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

/// The recording of one ESC of several: its number before the extension, which says the format.
fn numbered(path: &Path, esc: usize) -> PathBuf {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    path.with_extension(format!("{esc}.{extension}"))
}

/// Runs a session until its duration or an interrupt: on what `start` makes, with a warning where what
/// was stored is not whole. Tells `opened` once all is open, and `warn` in a line what a person should know
/// then or later; gives back what it was at the end.
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
    let (mut web, no_page) = Web::open(&session.web, session.flash.len(), &session.recordings())?;
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
            // The recording of what led there is worth having.
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
