//! MAVLink's byte streams: UDP, TCP, serial ports and pseudo-terminals.
//!
//! Nothing here blocks or reads a clock: the emulator's single loop calls [`Links::receive`] with
//! the time at least once a millisecond, and [`Links::send`] whenever there is a frame.

mod endpoint;
mod error;
mod pacer;
#[cfg(unix)]
mod pty;
mod serial;
mod socket;
mod stream;
mod tcp;
mod tty;
mod udp;

pub use endpoint::{DEFAULT_BAUD, Endpoint, EndpointError, EndpointReason};
pub use error::LinkError;
pub use siskin_scope::{AddressError, HostPort};
pub use stream::{Event, Ids, LinkId};

#[cfg(not(unix))]
use std::io;
use std::time::Duration;

use stream::{Inbox, Link};

/// Most bytes per read: the longest datagram.
const READ_BYTES: usize = 65_535;

/// What a loopback socket easily takes without loss.
pub const SOCKET_BYTES_PER_S: u32 = 1_000_000;

/// Every open MAVLink link.
#[derive(Default)]
pub struct Links {
    links: Vec<Box<dyn Link>>,
    buffer: Vec<u8>,
    ids: Ids,
}

impl Links {
    /// Opens all of them, or none: the first that fails closes those before it.
    pub fn open(endpoints: &[Endpoint]) -> Result<Self, LinkError> {
        let mut links = Vec::new();
        for endpoint in endpoints {
            if let Some(link) = open(endpoint)? {
                links.push(link);
            }
        }
        Ok(Self {
            links,
            buffer: vec![0; READ_BYTES],
            ids: Ids::default(),
        })
    }

    /// Passes pending data to `handle`, at most some 16 MB a second per stream. Serial lines also
    /// continue sending here. `now` is wall time since any fixed moment.
    pub fn receive(&mut self, now: Duration, mut handle: impl FnMut(LinkId, Event<'_>)) {
        let mut inbox = Inbox {
            now,
            ids: &mut self.ids,
            buffer: &mut self.buffer,
            handle: &mut handle,
        };
        for link in &mut self.links {
            link.receive(&mut inbox);
        }
    }

    /// Sends a frame to every peer of every link; never waits. Returns the number of peers without
    /// room, each of which has lost the whole frame.
    pub fn send(&mut self, frame: &[u8]) -> u64 {
        self.links.iter_mut().map(|link| link.send(frame)).sum()
    }

    /// Returns an id for a stream carried by another part of the program.
    pub fn stream(&mut self) -> LinkId {
        self.ids.give()
    }

    /// Returns the rate of the slowest link, bytes/s: a terminal's, or if there is none, what a
    /// loopback socket takes without loss.
    pub fn slowest_bytes_per_s(&self) -> u32 {
        let bauds = self.links.iter().filter_map(|link| match link.endpoint() {
            Endpoint::Serial { baud, .. } | Endpoint::Pty { baud, .. } => Some(baud),
            _ => None,
        });
        bauds.min().map_or(SOCKET_BYTES_PER_S, |baud| baud / 10)
    }

    /// Returns the actual endpoints: a port of 0 is replaced by the assigned one.
    pub fn endpoints(&self) -> Vec<Endpoint> {
        self.links.iter().map(|link| link.endpoint()).collect()
    }

    /// Describes each link in a line for the user, in the order of opening.
    pub fn describe(&self) -> Vec<String> {
        self.links.iter().map(|link| link.describe()).collect()
    }
}

fn open(endpoint: &Endpoint) -> Result<Option<Box<dyn Link>>, LinkError> {
    Ok(Some(match endpoint {
        Endpoint::None => return Ok(None),
        Endpoint::UdpOut(address) => Box::new(udp::Udp::outward(endpoint, address)?),
        Endpoint::UdpIn(address) => Box::new(udp::Udp::inward(endpoint, address)?),
        Endpoint::TcpIn(address) => Box::new(tcp::TcpServer::open(endpoint, address)?),
        Endpoint::Serial { path, baud } => {
            let port = serial::Serial::open(path, *baud);
            let port = port.map_err(|source| LinkError::Serial {
                endpoint: endpoint.clone(),
                source,
            })?;
            Box::new(tty::Tty::new(port, *baud))
        }
        #[cfg(unix)]
        Endpoint::Pty { link, baud } => {
            let port = pty::Pty::open(endpoint, link.as_deref(), *baud)?;
            Box::new(tty::Tty::new(port, *baud))
        }
        #[cfg(not(unix))]
        Endpoint::Pty { .. } => {
            return Err(LinkError::Pty {
                endpoint: endpoint.clone(),
                source: io::ErrorKind::Unsupported.into(),
            });
        }
    }))
}

#[cfg(test)]
mod tests;
