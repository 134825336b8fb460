//! MAVLink over UDP, outward to an address and inward from any sender.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::Duration;

use siskin_scope::HostPort;

use super::socket::{resolve, socket_error};
use super::stream::{Event, Inbox, Link, LinkId, is_pending};
use super::{Endpoint, LinkError};

/// Datagrams taken per call: more than a ground station sends in the millisecond between two.
const DATAGRAMS_PER_CALL: usize = 64;

/// Peers remembered; the one silent longest makes room for another.
const MAX_PEERS: usize = 16;

/// A peer silent for this long is forgotten. Every MAVLink system sends a heartbeat each second; a
/// listening script has a minute between two requests.
const PEER_SILENCE: Duration = Duration::from_secs(60);

/// A socket, its fixed target if any, and the peers that it has heard.
pub(super) struct Udp {
    socket: UdpSocket,
    target: Option<SocketAddr>,
    peers: Vec<Peer>,
    endpoint: Endpoint,
}

struct Peer {
    address: SocketAddr,
    id: LinkId,
    heard: Duration,
}

impl Udp {
    /// Opens a link that sends to `address` whether anyone listens there or not.
    pub(super) fn outward(endpoint: &Endpoint, address: &HostPort) -> Result<Self, LinkError> {
        let target = resolve(endpoint, address)?;
        // Traffic for this machine only must not be reachable from another one either.
        let local: IpAddr = match (target.ip(), target.ip().is_loopback()) {
            (ip, true) => ip,
            (IpAddr::V4(_), false) => Ipv4Addr::UNSPECIFIED.into(),
            (IpAddr::V6(_), false) => Ipv6Addr::UNSPECIFIED.into(),
        };
        let mut link = Self::bind(endpoint, (local, 0).into())?;
        link.target = Some(target);
        Ok(link)
    }

    /// Opens a link that sends to those that have sent to `address`.
    pub(super) fn inward(endpoint: &Endpoint, address: &HostPort) -> Result<Self, LinkError> {
        let local = resolve(endpoint, address)?;
        let mut link = Self::bind(endpoint, local)?;
        let given = link.socket.local_addr();
        let given = given.map_err(|error| socket_error(endpoint, error))?;
        link.endpoint = Endpoint::UdpIn(given.into());
        Ok(link)
    }

    fn bind(endpoint: &Endpoint, local: SocketAddr) -> Result<Self, LinkError> {
        let open = || -> io::Result<UdpSocket> {
            let socket = UdpSocket::bind(local)?;
            socket.set_nonblocking(true)?;
            // The given address may be a network's broadcast address.
            socket.set_broadcast(true)?;
            Ok(socket)
        };
        Ok(Self {
            socket: open().map_err(|error| socket_error(endpoint, error))?,
            target: None,
            peers: Vec::new(),
            endpoint: endpoint.clone(),
        })
    }

    /// Returns the stream of the peer at `address`, which has just been heard.
    fn hear(&mut self, address: SocketAddr, inbox: &mut Inbox<'_>) -> LinkId {
        if let Some(peer) = self.peers.iter_mut().find(|p| p.address == address) {
            peer.heard = inbox.now;
            return peer.id;
        }
        if self.peers.len() == MAX_PEERS {
            let silent = (0..MAX_PEERS).min_by_key(|i| self.peers[*i].heard);
            if let Some(index) = silent {
                let peer = self.peers.swap_remove(index);
                (inbox.handle)(peer.id, Event::Ended);
            }
        }
        let id = inbox.ids.give();
        self.peers.push(Peer {
            address,
            id,
            heard: inbox.now,
        });
        id
    }
}

impl Link for Udp {
    fn receive(&mut self, inbox: &mut Inbox<'_>) {
        for _ in 0..DATAGRAMS_PER_CALL {
            match self.socket.recv_from(inbox.buffer) {
                Ok((length, address)) => {
                    let id = self.hear(address, inbox);
                    (inbox.handle)(id, Event::Bytes(&inbox.buffer[..length]));
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                // Some systems report here that nobody received an earlier datagram.
                Err(_) => {}
            }
        }
        let now = inbox.now;
        self.peers.retain(|peer| {
            let stays = now.saturating_sub(peer.heard) < PEER_SILENCE;
            if !stays {
                (inbox.handle)(peer.id, Event::Ended);
            }
            stays
        });
    }

    fn send(&mut self, frame: &[u8]) -> u64 {
        let target = self.target;
        let heard = self.peers.iter().map(|peer| peer.address);
        let all = target
            .into_iter()
            .chain(heard.filter(|a| Some(*a) != target));
        // Only a full queue loses a present peer's frame: that nobody listens, or that the network
        // is down for now, is normal for datagrams.
        all.filter(|address| {
            let sent = self.socket.send_to(frame, address);
            sent.is_err_and(|error| is_pending(&error))
        })
        .count() as u64
    }

    fn endpoint(&self) -> Endpoint {
        self.endpoint.clone()
    }

    fn describe(&self) -> String {
        match &self.endpoint {
            Endpoint::UdpIn(address) => format!("UDP, listening on {address}"),
            Endpoint::UdpOut(address) => format!("UDP, sending to {address}"),
            other => other.to_string(),
        }
    }
}
