//! Bytes to and from an ESC: TCP, UDP or a serial port.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs, UdpSocket};
use std::time::Duration;

use serial2::SerialPort;

use crate::endpoint::Endpoint;
use crate::error::Error;

/// How long a TCP connection may take; a host that drops packets would otherwise block for minutes.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(3);
/// How long the operating system may hold outgoing bytes.
const WRITE_TIMEOUT: Duration = Duration::from_secs(1);
/// Vehicles that a waiting UDP port answers; a ninth is heard but not talked to.
const MAX_PEERS: usize = 8;

/// An open endpoint.
pub(crate) struct Link {
    endpoint: Endpoint,
    stream: Stream,
}

enum Stream {
    Tcp(TcpStream),
    /// Bound and waiting: everyone who has sent is answered.
    UdpIn(UdpSocket, Vec<SocketAddr>),
    UdpOut(UdpSocket),
    Serial(SerialPort),
}

impl Link {
    /// Opens the endpoint.
    ///
    /// # Errors
    /// [`Error::Link`] with the remedy.
    pub(crate) fn open(endpoint: &Endpoint) -> Result<Self, Error> {
        let (opened, remedy) = match endpoint {
            Endpoint::Tcp(address) => (
                connect_tcp(address).map(Stream::Tcp),
                "start the emulator (cargo run --release) or name another endpoint with --connect",
            ),
            Endpoint::UdpIn(address) => (
                UdpSocket::bind(address).map(|socket| Stream::UdpIn(socket, Vec::new())),
                "end the program that holds the port, or choose another with --connect",
            ),
            Endpoint::UdpOut(address) => (
                connect_udp(address).map(Stream::UdpOut),
                "name another endpoint with --connect",
            ),
            Endpoint::Serial { path, baud } => (
                open_serial(path, *baud).map(Stream::Serial),
                "check the cable, the path and its permissions",
            ),
        };
        opened
            .map(|stream| Self {
                endpoint: endpoint.clone(),
                stream,
            })
            .map_err(|e| Error::Link {
                endpoint: endpoint.to_string(),
                reason: plain(&e),
                remedy,
            })
    }

    /// Returns the endpoint, as it was named.
    pub(crate) fn endpoint(&self) -> &Endpoint {
        &self.endpoint
    }

    /// Waits at most `wait` for bytes; returns 0 if none came.
    ///
    /// # Errors
    /// [`Error::Link`] if the other side has closed or the device is gone.
    pub(crate) fn receive(&mut self, buffer: &mut [u8], wait: Duration) -> Result<usize, Error> {
        // A socket takes a zero timeout for none at all.
        let wait = wait.max(Duration::from_millis(1));
        let received = match &mut self.stream {
            Stream::Tcp(stream) => stream
                .set_read_timeout(Some(wait))
                .and_then(|()| stream.read(buffer))
                .and_then(open_still),
            Stream::UdpIn(socket, peers) => socket
                .set_read_timeout(Some(wait))
                .and_then(|()| socket.recv_from(buffer))
                .map(|(length, from)| {
                    if !peers.contains(&from) && peers.len() < MAX_PEERS {
                        peers.push(from);
                    }
                    length
                }),
            Stream::UdpOut(socket) => socket
                .set_read_timeout(Some(wait))
                .and_then(|()| socket.recv(buffer)),
            Stream::Serial(port) => port
                .set_read_timeout(wait)
                .and_then(|()| port.read(buffer))
                .and_then(open_still),
        };
        self.or_lost(received)
    }

    /// Sends bytes; on a waiting UDP port, to everyone who has been heard.
    ///
    /// # Errors
    /// [`Error::Link`] if the other side has closed or the device is gone.
    pub(crate) fn send(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let sent = match &mut self.stream {
            Stream::Tcp(stream) => stream.write_all(bytes),
            Stream::UdpIn(socket, peers) => peers
                .iter()
                .try_for_each(|peer| socket.send_to(bytes, peer).map(drop)),
            Stream::UdpOut(socket) => socket.send(bytes).map(drop),
            Stream::Serial(port) => port.write_all(bytes),
        };
        self.or_lost(sent.map(|()| 0)).map(drop)
    }

    /// Treats neither a timeout nor a UDP port that nobody has opened yet as an error.
    fn or_lost(&self, result: io::Result<usize>) -> Result<usize, Error> {
        let datagrams = matches!(self.stream, Stream::UdpIn(..) | Stream::UdpOut(_));
        match result {
            Ok(length) => Ok(length),
            Err(e) => match e.kind() {
                ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted => Ok(0),
                ErrorKind::ConnectionRefused | ErrorKind::ConnectionReset if datagrams => Ok(0),
                _ => Err(Error::Link {
                    endpoint: self.endpoint.to_string(),
                    reason: format!("connection lost ({})", plain(&e)),
                    remedy: "check that the other side is still running",
                }),
            },
        }
    }
}

/// A stream that reads zero bytes has been closed by the other side.
fn open_still(length: usize) -> io::Result<usize> {
    if length == 0 {
        Err(io::Error::new(
            ErrorKind::UnexpectedEof,
            "closed by the other side",
        ))
    } else {
        Ok(length)
    }
}

fn connect_tcp(address: &str) -> io::Result<TcpStream> {
    let mut failure = io::Error::new(ErrorKind::NotFound, "the host has no address");
    for address in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, CONNECT_TIMEOUT) {
            Ok(stream) => {
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(WRITE_TIMEOUT))?;
                return Ok(stream);
            }
            Err(e) => failure = e,
        }
    }
    Err(failure)
}

fn connect_udp(address: &str) -> io::Result<UdpSocket> {
    let mut failure = io::Error::new(ErrorKind::NotFound, "the host has no address");
    for address in address.to_socket_addrs()? {
        let any = if address.is_ipv4() {
            "0.0.0.0:0"
        } else {
            "[::]:0"
        };
        let socket = UdpSocket::bind(any)?;
        match socket.connect(address) {
            Ok(()) => return Ok(socket),
            Err(e) => failure = e,
        }
    }
    Err(failure)
}

fn open_serial(path: &str, baud: u32) -> io::Result<SerialPort> {
    let mut port = SerialPort::open(path, baud)?;
    port.set_write_timeout(WRITE_TIMEOUT)?;
    Ok(port)
}

/// Returns the system's message without the error number.
fn plain(error: &io::Error) -> String {
    let text = error.to_string();
    match text.split_once(" (os error") {
        Some((words, _)) => words.to_lowercase(),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_waiting_port_answers_whoever_has_been_heard() {
        let mut link = Link {
            endpoint: Endpoint::UdpIn("127.0.0.1:0".into()),
            stream: Stream::UdpIn(
                UdpSocket::bind("127.0.0.1:0").expect("loopback"),
                Vec::new(),
            ),
        };
        let Stream::UdpIn(socket, _) = &link.stream else {
            unreachable!("made so above")
        };
        let here = socket.local_addr().expect("bound");
        let vehicle = UdpSocket::bind("127.0.0.1:0").expect("loopback");
        vehicle
            .set_read_timeout(Some(Duration::from_secs(10)))
            .expect("a socket");
        vehicle.send_to(b"hello", here).expect("loopback");
        let mut buffer = [0; 16];
        let length = link
            .receive(&mut buffer, Duration::from_secs(10))
            .expect("open");
        assert_eq!(&buffer[..length], b"hello");
        link.send(b"you").expect("heard");
        let (length, from) = vehicle.recv_from(&mut buffer).expect("answered");
        assert_eq!((&buffer[..length], from), (&b"you"[..], here));
    }
}
