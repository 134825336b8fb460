//! MAVLink over TCP: a server for several clients at once.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

use mavlink::{MAV_STX, MAV_STX_V2};
use siskin_scope::HostPort;

use super::socket::{resolve, socket_error};
use super::stream::{Event, Inbox, Link, LinkId, is_pending};
use super::{Endpoint, LinkError};

/// Most clients at once. A further one replaces the client that has been silent longest, if any is, and is otherwise
/// turned away.
const MAX_CLIENTS: usize = 32;

/// Silence after which a client makes room for another: stations send a heartbeat every second.
const SILENT: Duration = Duration::from_secs(5);

/// Most bytes pending for a slow client, a minute of telemetry; a client that exceeds it is dropped.
const MAX_PENDING_BYTES: usize = 256 * 1024;

/// Bytes read from a client per call, 16 MB a second with one call a millisecond.
const READ_BYTES: usize = 16 * 1024;

/// What a frame begins with, of MAVLink 2 and of 1.
const STARTS: [u8; 2] = [MAV_STX_V2, MAV_STX];

/// The port and its clients.
pub(super) struct TcpServer {
    listener: TcpListener,
    clients: Vec<Client>,
    ended: Vec<LinkId>,
    endpoint: Endpoint,
}

struct Client {
    stream: TcpStream,
    id: LinkId,
    pending: VecDeque<u8>,
    /// When it connected, or bytes last came from it.
    heard: Duration,
    /// True once it has sent bytes.
    begun: bool,
}

impl TcpServer {
    pub(super) fn open(endpoint: &Endpoint, address: &HostPort) -> Result<Self, LinkError> {
        let address = resolve(endpoint, address)?;
        let open = || {
            let listener = TcpListener::bind(address)?;
            listener.set_nonblocking(true)?;
            let given = listener.local_addr()?;
            Ok((listener, given))
        };
        let (listener, given) = open().map_err(|error| socket_error(endpoint, error))?;
        Ok(Self {
            listener,
            clients: Vec::new(),
            ended: Vec::new(),
            endpoint: Endpoint::TcpIn(given.into()),
        })
    }

    fn accept(&mut self, inbox: &mut Inbox<'_>) {
        // The bound is for a flood of connections; those over the limit are closed at once.
        for _ in 0..MAX_CLIENTS {
            let stream = match self.listener.accept() {
                Ok((stream, _)) => stream,
                // A connection broke before it was accepted, or no descriptor is left: the port stays open and the next
                // call tries again.
                Err(_) => break,
            };
            // Telemetry is small frames that should not wait for each other's acknowledgement.
            let ready = stream
                .set_nonblocking(true)
                .and_then(|()| stream.set_nodelay(true));
            if ready.is_ok() && self.has_room(inbox.now) {
                self.clients.push(Client {
                    stream,
                    id: inbox.ids.give(),
                    pending: VecDeque::new(),
                    heard: inbox.now,
                    begun: false,
                });
            }
        }
    }

    /// Returns true if there is room for another client, dropping a silent one if necessary.
    fn has_room(&mut self, now: Duration) -> bool {
        if self.clients.len() < MAX_CLIENTS {
            return true;
        }
        let clients = self.clients.iter().enumerate();
        let quietest = clients.min_by_key(|(_, client)| client.heard);
        let Some(place) = quietest.map(|(place, _)| place) else {
            return false;
        };
        if now.saturating_sub(self.clients[place].heard) < SILENT {
            return false;
        }
        self.ended.push(self.clients.remove(place).id);
        true
    }

    /// Keeps the clients for which `works` holds; the others are reported by the next `receive`.
    fn keep(&mut self, mut works: impl FnMut(&mut Client) -> bool) {
        let ended = &mut self.ended;
        self.clients.retain_mut(|client| {
            let stays = works(client);
            if !stays {
                ended.push(client.id);
            }
            stays
        });
    }
}

impl Client {
    /// Reads once. The end of the stream is an error, and so is a first byte that begins no frame: any page in a browser
    /// on this machine could hide frames in a request of whatever method or protocol.
    fn receive(&mut self, inbox: &mut Inbox<'_>) -> io::Result<()> {
        match self.stream.read(&mut inbox.buffer[..READ_BYTES]) {
            Ok(0) => Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(_) if !self.begun && !STARTS.contains(&inbox.buffer[0]) => {
                Err(io::ErrorKind::InvalidData.into())
            }
            Ok(length) => {
                self.begun = true;
                self.heard = inbox.now;
                (inbox.handle)(self.id, Event::Bytes(&inbox.buffer[..length]));
                Ok(())
            }
            Err(error) if is_pending(&error) => Ok(()),
            Err(error) => Err(error),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        while !self.pending.is_empty() {
            match self.stream.write(self.pending.as_slices().0) {
                Ok(length) => drop(self.pending.drain(..length)),
                Err(error) if is_pending(&error) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn send(&mut self, frame: &[u8]) -> io::Result<()> {
        if self.pending.len() + frame.len() > MAX_PENDING_BYTES {
            return Err(io::ErrorKind::OutOfMemory.into());
        }
        self.pending.extend(frame);
        self.flush()
    }
}

impl Link for TcpServer {
    fn receive(&mut self, inbox: &mut Inbox<'_>) {
        self.accept(inbox);
        self.keep(|client| client.receive(inbox).and_then(|()| client.flush()).is_ok());
        for id in self.ended.drain(..) {
            (inbox.handle)(id, Event::Ended);
        }
    }

    fn send(&mut self, frame: &[u8]) -> u64 {
        let before = self.clients.len();
        self.keep(|client| client.send(frame).is_ok());
        (before - self.clients.len()) as u64
    }

    fn endpoint(&self) -> Endpoint {
        self.endpoint.clone()
    }

    fn describe(&self) -> String {
        match &self.endpoint {
            Endpoint::TcpIn(address) => format!("TCP, listening on {address}"),
            other => other.to_string(),
        }
    }
}
