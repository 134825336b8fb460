//! ESCs controlled by a program in this process, such as the Python module: no socket, and simulated time advances by
//! calls.
//!
//! Each ESC gets its throttle as from a flight controller: a frame on its wire, at the same simulated times however the
//! calls divide time. So the result depends only on what is requested and when in simulated time, bit for bit, and
//! equals that of [`lockstep`](crate::lockstep) over UDP.

mod look;
mod outbox;
mod parameter;

use std::path::PathBuf;

use siskin_params::ParamId;
use thiserror::Error;

use crate::device::{Device, Start, StartError};
use crate::fault::Fault;
use crate::flash::{FileFlash, StorageError};
use crate::link::{Ids, LinkId, SOCKET_BYTES_PER_S};
use crate::machine::Machine;
use crate::rack::{Environment, OutOfRange, Rack};
use crate::rig::Bench;
use crate::scenario::ThrottleSignal;
use crate::watch::Void;
use crate::wire::{self, Wire};
use look::Look;
use outbox::Outbox;

pub use parameter::Refused;

/// The contents of a laboratory.
pub struct Setup {
    /// The bench of each ESC; they share one supply.
    pub bench: Bench,
    /// How many ESCs: 1 to [`ESCS_MAX`](crate::rack::ESCS_MAX).
    pub escs: usize,
    /// How throttle is sent.
    pub signal: ThrottleSignal,
    /// Parameters that override the stored ones and are not stored themselves.
    pub params: Vec<(ParamId, f32)>,
    /// The file behind the flash, with the ESC's number appended if there are several; `None` stores nothing.
    pub storage: Option<PathBuf>,
    /// Whether each control period is kept until taken.
    pub records: bool,
    /// Whether the control's state is hashed.
    pub traces: bool,
}

/// Why a laboratory cannot be set up; one line.
#[derive(Debug, Error)]
pub enum SetupError {
    /// The file behind the flash.
    #[error("{0}")]
    Storage(#[from] StorageError),
    /// An ESC does not start.
    #[error("{0}")]
    Start(#[from] StartError),
}

/// ESCs that run as a program says.
pub struct Laboratory {
    rack: Rack,
    signal: ThrottleSignal,
    /// Throttle of each ESC, 0 to 1; `None` for a silent wire.
    throttles: Vec<Option<f64>>,
    /// When the next frames are due, ns.
    frames_due_ns: u64,
    look: Look,
    outbox: Outbox,
    streams: Ids,
    /// The program's own stream.
    stream: LinkId,
    /// What was injected into each ESC, as given.
    faults: Vec<Vec<(Fault, String)>>,
}

impl Laboratory {
    /// Powers the ESCs up, with zero throttle on their wires. Returns a warning for each whose stored parameters are
    /// not intact.
    ///
    /// # Errors
    /// The storage is unusable, or an ESC does not start.
    pub fn set_up(setup: Setup) -> Result<(Self, Vec<&'static str>), SetupError> {
        let Setup {
            bench,
            escs,
            signal,
            params,
            storage,
            records,
            traces,
        } = setup;
        let mut streams = Ids::default();
        let flash = match storage {
            Some(path) => FileFlash::open_each(&path, escs)?,
            None => (0..escs).map(|_| FileFlash::in_memory()).collect(),
        };
        let starts = flash.into_iter().map(|flash| Start {
            bench: bench.clone(),
            wire: Wire::detached(),
            flash,
            overrides: params.clone(),
            defaults: Vec::new(),
            faults: Vec::new(),
            link_bytes_per_s: SOCKET_BYTES_PER_S,
        });
        let (rack, warnings) = Rack::start(starts.collect())?;
        let laboratory = Self {
            rack,
            signal,
            throttles: vec![Some(0.0); escs],
            frames_due_ns: 0,
            look: Look::new(escs, records, traces),
            outbox: Outbox::default(),
            stream: streams.give(),
            streams,
            faults: vec![Vec::new(); escs],
        };
        Ok((laboratory, warnings))
    }

    /// Returns the ESCs, with their states and answers.
    pub fn rack(&self) -> &Rack {
        &self.rack
    }

    /// Begins an advance: answers and means cover what [`Laboratory::go_on_to`] runs from here on.
    pub fn begin(&mut self) {
        self.rack.begin();
    }

    /// Runs all control periods that begin before `until_ns`, with the frames due.
    ///
    /// # Errors
    /// The simulated motor has diverged, or both switches of a leg may have been on.
    pub fn go_on_to(&mut self, until_ns: u64) -> Result<(), Void> {
        let outbox = &mut self.outbox;
        while self.rack.now_ns() < until_ns {
            let now_ns = self.rack.now_ns();
            if now_ns == self.frames_due_ns {
                self.frames_due_ns += self.signal.interval_ns();
                for (esc, throttle) in self.throttles.iter().enumerate() {
                    if let Some(throttle) = throttle {
                        let params = self.rack.escs()[esc].esc().params();
                        let datagram = self.signal.datagram(*throttle, params);
                        // If it finds no room after what the program has sent, its wire counts it.
                        let _ = self.rack.play(esc, now_ns, &datagram);
                    }
                }
            }
            let stride_ns = until_ns.min(self.frames_due_ns);
            let mut send = |frame: &[u8]| outbox.push(frame);
            self.rack.go_on_to(stride_ns, &mut self.look, &mut send);
            if let Some(void) = self.look.failed() {
                return Err(void);
            }
        }
        Ok(())
    }

    /// Returns the throttle of each ESC, 0 to 1; `None` for a silent wire.
    pub fn throttles(&self) -> &[Option<f64>] {
        &self.throttles
    }

    /// Sets an ESC's throttle from the next frame on, 0 to 1, or silences its wire.
    pub fn set_throttle(&mut self, esc: usize, throttle: Option<f64>) {
        self.throttles[esc] = throttle;
    }

    /// Plays a throttle-wire datagram for an ESC, `after_ns` from now or after what still plays.
    ///
    /// # Errors
    /// It is malformed, or too much is pending.
    pub fn send(
        &mut self,
        esc: usize,
        after_ns: u64,
        datagram: &[u8],
    ) -> Result<(), wire::Rejected> {
        let start_ns = self.rack.now_ns() + after_ns;
        self.rack.play(esc, start_ns, datagram)
    }

    /// Changes the ESCs' surroundings, from their next control periods on.
    ///
    /// # Errors
    /// A quantity is out of range; nothing has changed then.
    pub fn surround(&mut self, change: &Environment) -> Result<(), OutOfRange> {
        change.check()?;
        self.rack.surround(change);
        Ok(())
    }

    /// Sends MAVLink bytes to all ESCs.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.rack.receive(self.stream, bytes, &mut self.look);
    }

    /// Takes at most this many MAVLink bytes that the ESCs have sent. The latest 64 KB are kept, in whole frames.
    pub fn take_sent(&mut self, most: usize) -> Vec<u8> {
        self.outbox.take(most)
    }

    /// Injects a fault into an ESC that acts from its time on, replacing one of its kind; `text` is how it is listed.
    pub fn inject(&mut self, esc: usize, fault: Fault, text: String) {
        // The rack's ESCs can be broken.
        let _ = self.rack.inject(esc, fault);
        self.faults[esc].push((fault, text));
    }

    /// Repairs everything that faults have broken in an ESC so far.
    pub fn mend(&mut self, esc: usize) {
        let _ = self.rack.mend(esc);
    }

    /// Returns the faults of an ESC that act or are pending, as given.
    pub fn faults(&mut self, esc: usize) -> Vec<String> {
        let device = &self.rack.escs()[esc];
        let given = &mut self.faults[esc];
        given.retain(|(fault, _)| device.faults().contains(fault));
        let now_s = device.begins_s();
        let left = given.iter().filter(|(fault, _)| !fault.is_over(now_s));
        left.map(|(_, text)| text.clone()).collect()
    }

    /// Takes what has been recorded of an ESC: [packed rows](crate::record::Row::pack), one per control period.
    pub fn take_recorded(&mut self, esc: usize) -> Option<Vec<u8>> {
        self.look.take_recorded(esc)
    }

    /// Returns the hash over an ESC's control state in every step so far, as a scenario's `trace_hash`.
    pub fn trace_hash(&self, esc: usize) -> Option<String> {
        self.look.trace_hash(esc)
    }

    /// Returns an id for another MAVLink stream.
    fn new_stream(&mut self) -> LinkId {
        self.streams.give()
    }

    fn esc(&self, esc: usize) -> &Device {
        &self.rack.escs()[esc]
    }
}

#[cfg(test)]
mod tests;
