//! Real sockets on loopback and real terminals; the links' time is an argument.

#[cfg(unix)]
mod terminals;

use std::collections::BTreeMap;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::thread::sleep;
use std::time::Duration;

use super::stream::is_pending;
use super::*;

const MS: Duration = Duration::from_millis(1);

/// What a client's stream begins with: a frame's first byte.
const START: [u8; 1] = [0xFD];

/// A client's first bytes.
fn first(text: &[u8]) -> Vec<u8> {
    [&START, text].concat()
}

/// Open links, what each live stream received, and which streams have ended.
struct Bench {
    links: Links,
    now: Duration,
    streams: BTreeMap<LinkId, Vec<u8>>,
    ended: Vec<LinkId>,
}

impl Bench {
    fn open(endpoints: &[&str]) -> Self {
        let endpoints: Vec<_> = endpoints.iter().map(|e| e.parse().unwrap()).collect();
        Self {
            links: Links::open(&endpoints).unwrap(),
            now: Duration::from_secs(100),
            streams: BTreeMap::new(),
            ended: Vec::new(),
        }
    }

    fn receive(&mut self) {
        self.links.receive(self.now, |id, event| match event {
            Event::Bytes(bytes) => self.streams.entry(id).or_default().extend(bytes),
            Event::Ended => {
                self.streams.remove(&id);
                self.ended.push(id);
            }
        });
    }

    /// Receives until `done`. The kernel takes its time; the links see `step` per turn.
    fn until(&mut self, step: Duration, mut done: impl FnMut(&mut Self) -> bool) {
        for _ in 0..5000 {
            self.now += step;
            self.receive();
            if done(self) {
                return;
            }
            sleep(MS);
        }
        panic!("not within 5000 turns; streams {:?}", self.streams);
    }

    /// Whether a stream has brought this, after what [`first`] puts before it.
    fn heard(&self, text: &[u8]) -> bool {
        let bytes = self.streams.values();
        bytes
            .map(|bytes| bytes.strip_prefix(&START).unwrap_or(bytes))
            .any(|bytes| bytes == text)
    }

    /// Returns where the link of this index listens.
    fn address(&self, index: usize) -> SocketAddress {
        match &self.links.endpoints()[index] {
            Endpoint::UdpIn(address) | Endpoint::TcpIn(address) => {
                (address.host.clone(), address.port)
            }
            other => panic!("{other} does not listen"),
        }
    }

    fn connect(&mut self, index: usize) -> TcpStream {
        let client = TcpStream::connect(self.address(index)).unwrap();
        client
            .set_read_timeout(Some(Duration::from_secs(5)))
            .unwrap();
        client
    }

    /// Connects two clients, each of which has been heard.
    fn connect_two(&mut self) -> [TcpStream; 2] {
        let mut clients = [self.connect(0), self.connect(0)];
        for (client, name) in clients.iter_mut().zip([b"one", b"two"]) {
            client.write_all(&first(name)).unwrap();
        }
        self.until(MS, |b| b.heard(b"one") && b.heard(b"two"));
        clients
    }
}

type SocketAddress = (String, u16);

fn udp_socket() -> (UdpSocket, u16) {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket
        .set_read_timeout(Some(Duration::from_secs(5)))
        .unwrap();
    let port = socket.local_addr().unwrap().port();
    (socket, port)
}

fn datagram(socket: &UdpSocket) -> Vec<u8> {
    let mut buffer = [0; 512];
    let length = socket.recv(&mut buffer).unwrap();
    buffer[..length].to_vec()
}

fn read(stream: &mut impl Read, length: usize) -> Vec<u8> {
    let mut bytes = vec![0; length];
    stream.read_exact(&mut bytes).unwrap();
    bytes
}

/// Returns true if the bytes are 0 to 249 repeated, none missing.
fn is_counted(bytes: &[u8]) -> bool {
    bytes
        .iter()
        .enumerate()
        .all(|(i, byte)| *byte == (i % 250) as u8)
}

#[test]
fn udpout_sends_at_once_and_hears_whoever_answers() {
    let (station, port) = udp_socket();
    let mut bench = Bench::open(&[&format!("udpout:127.0.0.1:{port}")]);
    assert_eq!(
        bench.links.describe(),
        [format!("UDP, sending to 127.0.0.1:{port}")]
    );
    assert_eq!(bench.links.send(b"heartbeat"), 0);
    let mut buffer = [0; 64];
    let (length, esc) = station.recv_from(&mut buffer).unwrap();
    assert_eq!(&buffer[..length], b"heartbeat");
    assert!(esc.ip().is_loopback(), "out of reach from other machines");

    // Another socket of the ground station answers too, and is answered.
    let (other, _) = udp_socket();
    station.send_to(b"request", esc).unwrap();
    other.send_to(b"from another", esc).unwrap();
    bench.until(MS, |b| b.heard(b"request") && b.heard(b"from another"));
    bench.links.send(b"value");
    assert_eq!(datagram(&station), b"value");
    assert_eq!(datagram(&other), b"value");
    station.set_nonblocking(true).unwrap();
    assert!(
        station.recv(&mut buffer).is_err(),
        "the target gets each frame once"
    );
}

#[test]
fn that_nobody_listens_is_no_error() {
    let (station, port) = udp_socket();
    drop(station);
    let mut bench = Bench::open(&[&format!("udpout:127.0.0.1:{port}")]);
    for _ in 0..50 {
        assert_eq!(bench.links.send(b"heartbeat"), 0);
        bench.receive();
    }
    let station = UdpSocket::bind(("127.0.0.1", port)).unwrap();
    station
        .set_read_timeout(Some(Duration::from_secs(5)))
        .unwrap();
    bench.links.send(b"hello");
    assert_eq!(datagram(&station), b"hello");
    assert!(bench.ended.is_empty());
}

#[test]
fn udpin_sends_to_all_that_have_sent_in_the_last_minute() {
    let mut bench = Bench::open(&["udpin:127.0.0.1:0"]);
    let to = bench.address(0);
    let (first, _) = udp_socket();
    let (second, _) = udp_socket();
    bench.links.send(b"to nobody");
    first.send_to(b"one", &to).unwrap();
    second.send_to(b"two", &to).unwrap();
    bench.until(MS, |b| b.heard(b"one") && b.heard(b"two"));
    bench.links.send(b"to both");
    assert_eq!(datagram(&first), b"to both");
    assert_eq!(datagram(&second), b"to both");

    // The second stays silent for a minute; the first speaks once in between.
    bench.now += Duration::from_secs(30);
    first.send_to(b".", &to).unwrap();
    bench.until(MS, |b| b.heard(b"one."));
    assert!(bench.ended.is_empty());
    bench.now += Duration::from_secs(30);
    bench.receive();
    assert_eq!((bench.ended.len(), bench.streams.len()), (1, 1));
    bench.links.send(b"to the first");
    assert_eq!(datagram(&first), b"to the first");
    second.set_nonblocking(true).unwrap();
    assert!(second.recv(&mut [0; 64]).is_err());

    // It returns as another stream, so that no half frame is continued.
    second.send_to(b"back", &to).unwrap();
    bench.until(MS, |b| b.heard(b"back"));
    assert!(!bench.streams.contains_key(&bench.ended[0]));
}

#[test]
fn udpin_remembers_sixteen_peers() {
    let mut bench = Bench::open(&["udpin:127.0.0.1:0"]);
    let to = bench.address(0);
    let peers: Vec<_> = (0..20).map(|_| udp_socket().0).collect();
    for (index, peer) in peers.iter().enumerate() {
        peer.send_to(&[index as u8], &to).unwrap();
        bench.until(MS, |b| b.heard(&[index as u8]));
    }
    assert_eq!((bench.streams.len(), bench.ended.len()), (16, 4));
    assert!(
        (0..4).all(|index| !bench.heard(&[index])),
        "the longest silent went"
    );
}

#[test]
fn tcp_serves_several_clients_of_which_one_comes_back() {
    let mut bench = Bench::open(&["tcpin:127.0.0.1:0"]);
    let [mut one, mut two] = bench.connect_two();
    assert_eq!(bench.links.send(b"to both"), 0);
    assert_eq!(read(&mut one, 7), b"to both");
    assert_eq!(read(&mut two, 7), b"to both");

    drop(one);
    bench.until(MS, |b| b.ended.len() == 1);
    bench.links.send(b"to two");
    assert_eq!(read(&mut two, 6), b"to two");

    let mut one = bench.connect(0);
    one.write_all(&first(b"back")).unwrap();
    bench.until(MS, |b| b.heard(b"back") && b.heard(b"two"));
    bench.links.send(b"to both again");
    assert_eq!(read(&mut one, 13), b"to both again");
    assert_eq!(read(&mut two, 13), b"to both again");
    assert!(
        !bench.streams.contains_key(&bench.ended[0]),
        "a number is used once"
    );
}

#[test]
fn a_page_of_a_browser_is_no_client_whatever_its_request_carries() {
    let mut bench = Bench::open(&["tcpin:127.0.0.1:0"]);
    let begins = [
        &b"POST / HTTP/1.1\r\n\r\n"[..],
        b"GET /",
        b"P",
        // Any method can be asked for, and a secure page begins otherwise.
        b"PUT / HTTP/1.1\r\n\r\n\xFD",
        b"X",
        b"\x16\x03\x01",
        b"\r\n\xFD",
    ];
    for (count, begin) in begins.iter().enumerate() {
        let mut page = bench.connect(0);
        page.write_all(begin).unwrap();
        bench.until(MS, |b| b.ended.len() == count + 1);
        assert!(bench.streams.is_empty());
    }
    for start in [0xFD, 0xFE] {
        let mut client = bench.connect(0);
        client.write_all(&[start, 0]).unwrap();
        bench.until(MS, |b| b.streams.values().any(|bytes| bytes == &[start, 0]));
    }
}

#[test]
fn a_client_that_does_not_read_is_dropped_and_the_others_get_every_byte() {
    let mut bench = Bench::open(&["tcpin:127.0.0.1:0"]);
    let [mut slow, mut quick] = bench.connect_two();
    let frame: Vec<u8> = (0..250).collect();
    // The kernel's own buffers take some megabytes before ours begins to fill.
    let sent = (1..200_000_usize)
        .find(|_| {
            let lost = bench.links.send(&frame);
            assert_eq!(read(&mut quick, frame.len()), frame);
            lost == 1
        })
        .expect("the slow client fills up");
    assert!(sent * frame.len() > 256 * 1024);
    bench.receive();
    assert_eq!(bench.ended.len(), 1);
    assert!(bench.heard(b"two") && !bench.heard(b"one"));

    // What the slow client finally reads is whole and in order, then cut off.
    let mut found = Vec::new();
    // A connection closed with unread data may end as a reset.
    let _ = slow.read_to_end(&mut found);
    assert!(is_counted(&found));
}

#[test]
fn clients_beyond_the_limit_are_turned_away() {
    let mut bench = Bench::open(&["tcpin:127.0.0.1:0"]);
    let mut clients = Vec::new();
    for index in 0..32_u8 {
        let mut client = bench.connect(0);
        client.write_all(&first(&[index])).unwrap();
        bench.until(MS, |b| b.heard(&[index]));
        clients.push(client);
    }
    let mut late = bench.connect(0);
    bench.until(MS, |_| {
        late.set_nonblocking(true).unwrap();
        !matches!(late.read(&mut [0]), Err(error) if is_pending(&error))
    });
    assert_eq!(bench.streams.len(), 32);
}

#[test]
fn a_silent_client_makes_room_for_the_next() {
    let mut bench = Bench::open(&["tcpin:127.0.0.1:0"]);
    let mut clients = Vec::new();
    for index in 0..32_u8 {
        let mut client = bench.connect(0);
        client.write_all(&first(&[index])).unwrap();
        bench.until(MS, |b| b.heard(&[index]));
        clients.push(client);
    }
    bench.now += Duration::from_secs(6);
    for client in clients.iter_mut().skip(1) {
        client.write_all(b".").unwrap();
    }
    bench.until(MS, |b| {
        b.streams.values().filter(|bytes| bytes.len() == 3).count() == 31
    });
    let mut late = bench.connect(0);
    late.write_all(&first(b"late")).unwrap();
    bench.until(MS, |b| b.heard(b"late"));
    assert_eq!(clients[0].read(&mut [0]).unwrap(), 0, "it was closed");
    assert_eq!((bench.streams.len(), bench.ended.len()), (32, 1));
}

#[test]
fn a_frame_goes_to_every_link() {
    let (station, port) = udp_socket();
    let udpout = format!("udpout:localhost:{port}");
    let mut bench = Bench::open(&[&udpout, "none", "tcpin:127.0.0.1:0", "udpin:127.0.0.1:0"]);
    assert_eq!(bench.links.describe().len(), 3);
    let mut client = bench.connect(1);
    let (peer, _) = udp_socket();
    peer.send_to(b"peer", bench.address(2)).unwrap();
    client.write_all(&first(b"client")).unwrap();
    bench.until(MS, |b| b.heard(b"peer") && b.heard(b"client"));
    bench.links.send(b"frame");
    assert_eq!(read(&mut client, 5), b"frame");
    assert_eq!(datagram(&peer), b"frame");
    assert_eq!(datagram(&station), b"frame");
}

#[test]
fn a_taken_port_is_one_line_with_the_endpoint_and_the_remedy() {
    let tcp = TcpListener::bind("127.0.0.1:0").unwrap();
    let (_udp, udp_port) = udp_socket();
    for text in [
        format!("tcpin:{}", tcp.local_addr().unwrap()),
        format!("udpin:127.0.0.1:{udp_port}"),
    ] {
        let opened = Links::open(&[text.parse().unwrap()]);
        let line = opened.err().expect("the port is taken").to_string();
        assert!(
            line.contains(&text) && line.contains("another port"),
            "{line}"
        );
        assert!(!line.contains('\n'), "{line}");
    }
    for text in [
        // A label has at most 63 characters, so no name server is asked.
        &format!("udpout:{}:1", "h".repeat(64)),
        // TEST-NET-1: no address of any machine.
        "tcpin:192.0.2.1:5760",
        "serial:/no/such/device:115200",
    ] {
        let opened = Links::open(&[text.parse().unwrap()]);
        let line = opened.err().expect("it cannot be opened").to_string();
        assert!(line.contains(text) && !line.contains('\n'), "{line}");
    }
}
