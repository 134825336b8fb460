//! The throttle wire: datagrams in, edges on the simulation's time axis out.
//!
//! A datagram is one frame as a flight controller's timer would put it on the wire, or any run of levels. Nothing is
//! decoded here: the edges go to the same capture decoder as on the chip.

mod frame;
mod rejected;

use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::str::FromStr;
use std::time::Duration;

use thiserror::Error;

use crate::link::{AddressError, HostPort};
use crate::plant::Noise;
use frame::Frame;
pub use rejected::Rejected;

/// Longest backlog to be played, ns; a datagram that would have to wait longer is dropped.
pub const MAX_BACKLOG_NS: u64 = 100_000_000;

/// Most pending edges: more than 100 ms of DShot1200 (193 thousand), so that only raw edges far beyond any protocol's
/// rate reach it.
const MAX_EDGES: usize = 1 << 18;

/// Datagrams taken per call: three times DShot1200's 75 frames per millisecond.
const DATAGRAMS_PER_CALL: usize = 256;

/// How much earlier than sent the ESC may time a frame's first edge, ns: a tick of its timer, plus the edge's jitter.
/// Half the spacing of the shortest frames, 16.7 µs.
const EARLY_NS: u64 = 8_000;

/// Age beyond which a frame is no longer answered, ns. The ESC answers within a frame, 107 µs at most, and two control
/// periods, 125 µs each.
const ANSWERED_NS: u64 = 1_000_000;

/// The longest datagram.
const READ_BYTES: usize = 65_535;

/// The wire's address: the argument of `--signal`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SignalAddress(HostPort);

/// Why a text is not a wire's address.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "'{text}' is not a throttle wire: {reason}; use udp:HOST:PORT, such as udp:127.0.0.1:14600"
)]
pub struct SignalError {
    /// What was given.
    pub text: String,
    /// What is wrong with it.
    pub reason: SignalReason,
}

/// What is wrong with a wire's address.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum SignalReason {
    /// It is not UDP.
    #[error("it does not start with udp:")]
    Kind,
    /// The host or the port is wrong.
    #[error(transparent)]
    Address(#[from] AddressError),
}

/// Why a wire cannot be opened: one line, with what to do.
#[derive(Debug, Error)]
pub enum WireError {
    /// The ports above the first do not reach far enough for this ESC.
    #[error("--signal {0}: the wire of ESC {1} would be above port 65535; give a lower port")]
    NoPort(SignalAddress, u16),
    /// The host's name has no address.
    #[error("--signal {0}: the host cannot be resolved ({1}); give an address, such as 127.0.0.1")]
    Host(SignalAddress, io::Error),
    /// Another program listens there.
    #[error(
        "--signal {0}: port {1} is taken; end the program that holds it or give another port (0 \
         takes any free one)"
    )]
    Taken(SignalAddress, u16),
    /// The system refuses the socket.
    #[error("--signal {0}: cannot open the socket ({1}); give an address of this machine")]
    Socket(SignalAddress, io::Error),
}

/// Checks that a datagram could be played.
///
/// # Errors
/// It is malformed.
pub fn check(datagram: &[u8]) -> Result<(), Rejected> {
    Frame::parse(datagram).map(|_| ())
}

/// Counts of the datagrams so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireCounts {
    /// Turned into edges.
    pub played: u64,
    /// Malformed.
    pub rejected: u64,
    /// Dropped, because too much was pending.
    pub dropped: u64,
}

/// What is wrong with a wire.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WireErrors {
    /// Nothing sent comes through.
    pub lost: bool,
    /// Probability that a bit of a DShot frame is inverted.
    pub bit_error_rate: f64,
    /// Jitter of edges, ns rms; they stay in order.
    pub jitter_ns: f64,
}

/// One ESC's throttle wire. Its line is initially low.
///
/// Time is the simulation's, in ns, and does not decrease from call to call.
pub struct Wire {
    socket: Option<UdpSocket>,
    /// Whether the socket waits for datagrams.
    waits: bool,
    buffer: Vec<u8>,
    /// Who sends, and from when on: the recipients of answers. `None` is a player without a socket.
    senders: VecDeque<(u64, Option<SocketAddr>)>,
    counts: WireCounts,
    edges: VecDeque<(u64, bool)>,
    /// The level after everything pending.
    level: bool,
    /// Edges have been handed out up to here; nothing is added before it.
    taken_ns: u64,
    /// The end of the last frame and the rest required after it.
    last: Option<(u64, u64)>,
    errors: WireErrors,
    noise: Noise,
    /// When the socket last delivered a frame.
    heard_ns: Option<u64>,
    /// The latest frame's throttle, 0 to 1.
    throttle: f64,
}

impl Wire {
    /// Creates a wire without a socket: only [`Wire::play`] feeds it.
    pub fn detached() -> Self {
        Self {
            socket: None,
            waits: false,
            buffer: Vec::new(),
            senders: VecDeque::new(),
            counts: WireCounts::default(),
            edges: VecDeque::new(),
            level: false,
            taken_ns: 0,
            last: None,
            errors: WireErrors::default(),
            noise: Noise::new(0),
            heard_ns: None,
            throttle: 0.0,
        }
    }

    /// Seeds its errors.
    pub fn sow(&mut self, seed: u64) {
        // A different sequence from the sensors' noise with the same seed.
        self.noise = Noise::new(!seed);
    }

    /// Sets what is wrong with it from now on.
    pub fn disturb(&mut self, errors: WireErrors) {
        self.errors = errors;
    }

    /// Opens the wire of ESC `index`: `address` with its port raised by `index`. With port 0 each gets a free port of
    /// its own.
    pub fn open(address: &SignalAddress, index: u16) -> Result<Self, WireError> {
        let no_port = || WireError::NoPort(address.clone(), index);
        let HostPort { host, port } = &address.0;
        let port = match port {
            0 => 0,
            _ => port.checked_add(index).ok_or_else(no_port)?,
        };
        let host = host.clone();
        let local = HostPort { host, port }.resolve();
        let local = local.map_err(|error| WireError::Host(address.clone(), error))?;
        let open = || {
            let socket = UdpSocket::bind(local)?;
            socket.set_nonblocking(true)?;
            Ok(socket)
        };
        let socket = open().map_err(|error: io::Error| match error.kind() {
            io::ErrorKind::AddrInUse => WireError::Taken(address.clone(), port),
            _ => WireError::Socket(address.clone(), error),
        })?;
        Ok(Self {
            socket: Some(socket),
            buffer: vec![0; READ_BYTES],
            ..Self::detached()
        })
    }

    /// Returns where it listens, with the actual port if the system chose it. `None` without a socket.
    pub fn local_address(&self) -> Option<SocketAddr> {
        self.socket.as_ref()?.local_addr().ok()
    }

    /// Returns the counts of the datagrams so far.
    pub fn counts(&self) -> WireCounts {
        self.counts
    }

    /// Returns when the socket last delivered a frame that was played, ns.
    pub fn heard_ns(&self) -> Option<u64> {
        self.heard_ns
    }

    /// Returns the latest frame's throttle, 0 to 1 of its range, for display; 0 before the first one, and for raw
    /// edges.
    pub fn throttle(&self) -> f64 {
        self.throttle
    }

    /// Plays the received datagrams, the first from `now_ns` on. Never waits.
    pub fn poll(&mut self, now_ns: u64) {
        // Taken out for the loop, since playing borrows the whole wire.
        let (Some(socket), mut buffer) = (self.socket.take(), std::mem::take(&mut self.buffer))
        else {
            return;
        };
        for _ in 0..DATAGRAMS_PER_CALL {
            match socket.recv_from(&mut buffer) {
                Ok((length, sender)) => {
                    if let Ok(Some(start_ns)) = self.take(now_ns, &buffer[..length]) {
                        self.heard_ns = Some(now_ns);
                        self.sends(start_ns, Some(sender));
                    }
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                // Some systems report here that an earlier answer reached nobody.
                Err(_) => {}
            }
        }
        self.socket = Some(socket);
        self.buffer = buffer;
    }

    /// Waits for a datagram, for at most `time`, and plays it; one that `is_request` is put into `request` instead, and
    /// its sender is returned.
    pub fn wait(
        &mut self,
        now_ns: u64,
        time: Duration,
        is_request: fn(&[u8]) -> bool,
        request: &mut Vec<u8>,
    ) -> Option<SocketAddr> {
        let socket = self.socket.as_ref()?;
        if !self.waits {
            socket.set_nonblocking(false).ok()?;
            socket.set_read_timeout(Some(time)).ok()?;
            self.waits = true;
        }
        // Some systems report here that an earlier answer reached nobody.
        let (length, sender) = socket.recv_from(&mut self.buffer).ok()?;
        let buffer = std::mem::take(&mut self.buffer);
        let datagram = &buffer[..length];
        let asks = is_request(datagram);
        if asks {
            request.clear();
            request.extend(datagram);
        } else if let Ok(Some(start_ns)) = self.take(now_ns, datagram) {
            self.sends(start_ns, Some(sender));
        }
        self.buffer = buffer;
        asks.then_some(sender)
    }

    /// Sends a datagram to its requester; one who does not take it loses it.
    pub fn send_to(&self, peer: SocketAddr, datagram: &[u8]) {
        if let Some(socket) = &self.socket {
            let _ = socket.send_to(datagram, peer);
        }
    }

    /// Plays one datagram from `now_ns` on, or after what still plays, and counts it.
    pub fn play(&mut self, now_ns: u64, datagram: &[u8]) -> Result<(), Rejected> {
        let start_ns = self.take(now_ns, datagram)?;
        if let Some(start_ns) = start_ns
            && !self.senders.is_empty()
        {
            self.sends(start_ns, None);
        }
        Ok(())
    }

    /// Sends an answer to the sender of what was played at `asked_ns`, if known. A sender that does not take it loses
    /// it, as on a wire that nobody listens to.
    pub fn send(&mut self, asked_ns: u64, datagram: &[u8]) {
        self.forget_senders(asked_ns.saturating_add(EARLY_NS));
        if let (Some(socket), Some((_, Some(sender)))) = (&self.socket, self.senders.front()) {
            let _ = socket.send_to(datagram, sender);
        }
    }

    /// Records who sends from this time on.
    fn sends(&mut self, start_ns: u64, sender: Option<SocketAddr>) {
        // Most signals are not answered.
        self.forget_senders(self.taken_ns.saturating_sub(ANSWERED_NS));
        if self.senders.back().is_none_or(|last| last.1 != sender) {
            self.senders.push_back((start_ns, sender));
        }
    }

    /// Forgets the senders before the one at this time.
    fn forget_senders(&mut self, at_ns: u64) {
        while self.senders.get(1).is_some_and(|next| next.0 <= at_ns) {
            self.senders.pop_front();
        }
    }

    /// Plays a datagram as [`Wire::play`] does; returns when its first level begins, if it comes through.
    fn take(&mut self, now_ns: u64, datagram: &[u8]) -> Result<Option<u64>, Rejected> {
        let frame = Frame::parse(datagram);
        let result = frame.and_then(|frame| {
            if self.errors.lost {
                return Ok(None);
            }
            self.throttle = frame.throttle();
            let frame = self.flipped(frame);
            self.append(now_ns, &frame).map(Some)
        });
        match result {
            Ok(_) => self.counts.played += 1,
            Err(Rejected::Backlog) => self.counts.dropped += 1,
            Err(_) => self.counts.rejected += 1,
        }
        result
    }

    /// Returns the next edge before `before_ns`: its time and the level after it. Edges come in order, each later than
    /// the one before and of another level. What is played from now on comes at `before_ns` or later.
    pub fn next_edge(&mut self, before_ns: u64) -> Option<(u64, bool)> {
        self.taken_ns = self.taken_ns.max(before_ns);
        let (time_ns, _) = self.edges.front()?;
        if *time_ns < before_ns {
            self.edges.pop_front()
        } else {
            None
        }
    }

    /// Applies the wire's bit errors to a frame.
    fn flipped<'a>(&mut self, mut frame: Frame<'a>) -> Frame<'a> {
        let rate = self.errors.bit_error_rate;
        if let Frame::DShot { bits, .. } = &mut frame
            && rate > 0.0
        {
            for bit in 0..16 {
                *bits ^= u16::from(self.noise.chance(rate)) << bit;
            }
        }
        frame
    }

    /// Returns when an edge sent at a time arrives, ns: after the one before.
    fn displaced(&mut self, time_ns: u64) -> u64 {
        let jitter_ns = self.errors.jitter_ns * self.noise.gaussian();
        let earliest_ns = self.edges.back().map_or(0, |(last_ns, _)| last_ns + 1);
        time_ns
            .saturating_add_signed(libm::round(jitter_ns) as i64)
            .max(earliest_ns)
            .max(self.taken_ns)
    }

    fn append(&mut self, now_ns: u64, frame: &Frame<'_>) -> Result<u64, Rejected> {
        let now_ns = now_ns.max(self.taken_ns);
        let mut start_ns = match self.last {
            // Between frames of different rates the longer rest counts.
            Some((end_ns, rest_ns)) => {
                now_ns.max(end_ns.saturating_add(rest_ns.max(frame.rest_before_ns())))
            }
            None => now_ns,
        };
        let edges = self.edges.len() + frame.max_edges();
        if start_ns - now_ns > MAX_BACKLOG_NS || edges > MAX_EDGES {
            return Err(Rejected::Backlog);
        }
        if frame.idle_level().is_some_and(|idle| idle != self.level) {
            // The line first rests on the frame's level, or its first edge would be none.
            self.set_level(start_ns, !self.level);
            start_ns = start_ns.saturating_add(frame.rest_before_ns());
        }
        frame.levels(|offset_ns, level| self.set_level(start_ns.saturating_add(offset_ns), level));
        let end_ns = start_ns.saturating_add(frame.duration_ns());
        self.last = Some((end_ns, frame.rest_after_ns()));
        Ok(start_ns)
    }

    fn set_level(&mut self, time_ns: u64, level: bool) {
        if level == self.level {
            return;
        }
        self.level = level;
        let time_ns = if self.errors.jitter_ns > 0.0 {
            self.displaced(time_ns)
        } else {
            // A pending edge may have been displaced beyond it.
            match self.edges.back() {
                Some((last_ns, _)) if *last_ns > time_ns => last_ns + 1,
                _ => time_ns,
            }
        };
        // A level held for 0 ns does not count.
        if self
            .edges
            .back()
            .is_some_and(|(last_ns, _)| *last_ns == time_ns)
        {
            self.edges.pop_back();
        } else {
            self.edges.push_back((time_ns, level));
        }
    }
}

impl FromStr for SignalAddress {
    type Err = SignalError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let address = text.strip_prefix("udp:").ok_or(SignalReason::Kind);
        let address = address.and_then(|address| Ok(address.parse()?));
        address.map(Self).map_err(|reason| SignalError {
            text: text.to_owned(),
            reason,
        })
    }
}

impl fmt::Display for SignalAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "udp:{}", self.0)
    }
}

#[cfg(test)]
mod tests;
