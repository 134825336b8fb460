//! An ESC in real time, on its MAVLink links and its throttle wire.
//!
//! One thread: it wakes each millisecond, takes in what has come on the sockets, simulates up to
//! the present and sends. An answer leaves within two milliseconds.

mod keeping;

use std::path::PathBuf;
use std::sync::atomic::Ordering;
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
use crate::watch::{Watch, WatchError};
use crate::wire::{SignalAddress, Wire, WireError};
use keeping::Keeping;

/// Wall time between two looks at the sockets.
const SLICE: Duration = Duration::from_millis(1);

/// Lag behind the wall clock that is given up rather than caught up with: the machine slept.
const GIVEN_UP: Duration = Duration::from_millis(500);

/// A control period at the lowest PWM frequency, 8 kHz, and some more, ns.
const LONGEST_PERIOD_NS: u64 = 130_000;

/// How fast simulated time passes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// So many simulated seconds a second.
    Times(f64),
    /// As fast as the machine can.
    Max,
}

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

/// Keeps simulated time in step with the wall's.
struct Pacer {
    pace: Pace,
    began: Instant,
    /// Where the two clocks last met: wall time since the start, and simulated ns.
    met: (Duration, u64),
}

impl Pacer {
    fn new(pace: Pace) -> Self {
        Self {
            pace,
            began: Instant::now(),
            met: (Duration::ZERO, 0),
        }
    }

    /// How far to simulate now, in slices that take a millisecond of the wall's time.
    fn until_ns(&mut self, now_ns: u64) -> u64 {
        let Pace::Times(times) = self.pace else {
            // The sockets are looked at once in 20 ms of simulation, which take less than one.
            return now_ns + 20_000_000;
        };
        let wall = self.began.elapsed();
        let due_ns = self.met.1 + ((wall - self.met.0).as_secs_f64() * times * 1e9) as u64;
        if due_ns.saturating_sub(now_ns) > (GIVEN_UP.as_secs_f64() * times * 1e9) as u64 {
            self.met = (wall, now_ns);
        }
        due_ns.min(now_ns + slice_ns(times))
    }

    /// Sleeps until a slice is due.
    fn wait(&self, now_ns: u64) {
        let Pace::Times(times) = self.pace else {
            return;
        };
        let simulated_s = (now_ns + slice_ns(times) - self.met.1) as f64 * 1e-9;
        let due = self.met.0 + Duration::from_secs_f64(simulated_s / times);
        std::thread::sleep(due.saturating_sub(self.began.elapsed()));
    }
}

/// What is simulated in a millisecond of the wall's time; in slow motion at least a control period.
fn slice_ns(times: f64) -> u64 {
    ((SLICE.as_nanos() as f64 * times) as u64).max(LONGEST_PERIOD_NS)
}
