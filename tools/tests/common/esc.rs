//! An ESC to talk to: the real MAVLink component on a loopback TCP port, without a motor.

use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use siskin_control::build::BuildError;
use siskin_control::check::Report;
use siskin_control::mavlink::{Component, Context, Frame, Receiver, Request, Warning, digits};
use siskin_control::telemetry::Telemetry;
use siskin_emulator::plant::Sensing;
use siskin_params::{Delay, ParamId, Params};
use siskin_throttle::authority::{Authority, Timing};

use crate::run::{Run, siskin};

const HEARTBEAT: u32 = 0;
const PARAM_VALUE: u32 = 22;

/// How an ESC behaves.
#[derive(Clone, Copy, Default)]
pub(crate) struct Behaviour {
    /// One in this many parameter messages is lost, in each direction.
    pub(crate) lose_every: Option<u32>,
    /// Why parameters cannot be stored.
    pub(crate) storage_fault: Option<&'static str>,
}

/// The requests it received, and its final values.
pub(crate) struct Outcome {
    pub(crate) params: Params,
    pub(crate) saves: u32,
}

/// A running ESC, until [`Esc::stop`].
pub(crate) struct Esc {
    endpoint: String,
    stopping: Arc<AtomicBool>,
    thread: JoinHandle<Outcome>,
}

impl Esc {
    pub(crate) fn start(behaviour: Behaviour) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free loopback port");
        listener.set_nonblocking(true).expect("a socket");
        let endpoint = format!("tcp:{}", listener.local_addr().expect("bound"));
        let stopping = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&stopping);
        let thread = thread::spawn(move || serve(&listener, behaviour, &stop));
        Self {
            endpoint,
            stopping,
            thread,
        }
    }

    /// Runs `siskin --connect` on it with these arguments.
    pub(crate) fn siskin(&self, arguments: &[&str]) -> Run {
        siskin(&[&["--connect", &self.endpoint], arguments].concat())
    }

    pub(crate) fn stop(self) -> Outcome {
        self.stopping.store(true, Ordering::Relaxed);
        self.thread.join().expect("the ESC ends without a panic")
    }
}

/// Carries an ESC's bytes over UDP.
pub(crate) struct UdpRelay {
    endpoint: String,
    stopping: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl UdpRelay {
    /// Starts a bridge that waits for a `udpout` client, or one that sends first to a `udpin` client.
    pub(crate) fn start(esc: &Esc, waits: bool) -> Self {
        let address = esc.endpoint.strip_prefix("tcp:").expect("made so");
        let stream = TcpStream::connect(address).expect("it listens");
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free loopback port");
        let (endpoint, peer) = if waits {
            (
                format!("udpout:{}", socket.local_addr().expect("bound")),
                None,
            )
        } else {
            // A port that was just free, for siskin to bind.
            let free = UdpSocket::bind("127.0.0.1:0").expect("a free loopback port");
            let address = free.local_addr().expect("bound");
            (format!("udpin:{address}"), Some(address))
        };
        let stopping = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&stopping);
        let thread = thread::spawn(move || relay(stream, &socket, peer, &stop));
        Self {
            endpoint,
            stopping,
            thread,
        }
    }

    pub(crate) fn endpoint(&self) -> &str {
        &self.endpoint
    }

    pub(crate) fn stop(self) {
        self.stopping.store(true, Ordering::Relaxed);
        self.thread.join().expect("the relay ends without a panic");
    }
}

fn relay(
    mut stream: TcpStream,
    socket: &UdpSocket,
    mut peer: Option<SocketAddr>,
    stop: &AtomicBool,
) {
    let wait = Some(Duration::from_millis(1));
    stream.set_read_timeout(wait).expect("a socket");
    socket.set_read_timeout(wait).expect("a socket");
    let mut buffer = [0; 2048];
    while !stop.load(Ordering::Relaxed) {
        if let Ok(length) = stream.read(&mut buffer) {
            // Datagrams may fail: the other end may not listen yet, or any more.
            let _ = peer.map(|peer| socket.send_to(&buffer[..length], peer));
        }
        if let Ok((length, from)) = socket.recv_from(&mut buffer) {
            peer = Some(from);
            stream.write_all(&buffer[..length]).expect("the ESC runs");
        }
    }
}

/// Counts messages, and decides which are lost.
struct Loss {
    every: Option<u32>,
    seen: u32,
}

impl Loss {
    fn takes_next(&mut self) -> bool {
        self.seen += 1;
        self.every
            .is_some_and(|every| self.seen.is_multiple_of(every))
    }
}

/// Time after the last change at which the ESC tells what does not fit.
const QUIET: Duration = Duration::from_millis(500);

/// A rule that ties two parameters, like those of the drive's configuration.
fn validate(params: &Params) -> Result<(), BuildError> {
    if params.get(ParamId::CtlRpmMin) < params.get(ParamId::CtlRpmMax) {
        Ok(())
    } else {
        Err(BuildError {
            param: ParamId::CtlRpmMin,
            reason: "must be below CTL_RPM_MAX",
        })
    }
}

fn serve(listener: &TcpListener, behaviour: Behaviour, stop: &AtomicBool) -> Outcome {
    let started = Instant::now();
    // It has no values of its own from the factory.
    let board = Sensing::default().board(Delay::One);
    let mut params = Params::default();
    let mut authority = Authority::new(Timing {
        arm_us: 300_000,
        loss_us: 100_000,
    });
    let mut component = Component::new(&params, &board.image, 1_000_000);
    let mut client: Option<(TcpStream, Receiver)> = None;
    let mut lost_in = Loss {
        every: behaviour.lose_every,
        seen: 0,
    };
    let mut lost_out = Loss {
        every: behaviour.lose_every,
        seen: 0,
    };
    let mut saves = 0;
    let mut changed: Option<Instant> = None;
    while !stop.load(Ordering::Relaxed) {
        let now_us = u64::try_from(started.elapsed().as_micros()).expect("short");
        let telemetry = Telemetry {
            // At rest, so that every parameter may change, but not quite still.
            rpm: -42.0,
            bus_v: 24.0,
            bus_a: 3.5,
            consumed_mah: 12.0,
            temperature_c: 35.0,
            bad_frames: 7,
            ..Telemetry::new()
        };
        let mut context = Context {
            now_us,
            params: &mut params,
            board: &board,
            telemetry: &telemetry,
            four: None,
            check: &Report::new(40.0, 0.02),
            identification: &siskin_control::identify::Report::default(),
            record: None,
            authority: &mut authority,
            validate: &validate,
        };

        if let Ok((stream, _)) = listener.accept() {
            stream.set_nonblocking(false).expect("a socket");
            stream
                .set_read_timeout(Some(Duration::from_millis(1)))
                .expect("a socket");
            client = Some((stream, Receiver::new()));
        }
        let Some((stream, receiver)) = &mut client else {
            thread::sleep(Duration::from_millis(1));
            continue;
        };
        let mut buffer = [0; 1024];
        let read = match stream.read(&mut buffer) {
            Ok(0) => {
                client = None;
                continue;
            }
            Ok(read) => read,
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => 0,
            Err(_) => {
                client = None;
                continue;
            }
        };
        receiver.push(now_us, &buffer[..read], |frame: &Frame| {
            if frame.id == HEARTBEAT || !lost_in.takes_next() {
                component.handle(frame, &mut context);
            }
        });
        if changed.is_some_and(|at| at.elapsed() > QUIET) {
            changed = None;
            if let Err(error) = validate(context.params) {
                let value = digits(context.params.get(error.param));
                let mut text = Warning::new();
                for piece in [
                    "Motor off: ",
                    error.param.entry().name,
                    &value,
                    error.reason,
                ] {
                    text.push_str(piece).expect("there is room");
                }
                component.warn(text);
            }
        }
        let mut sent = Vec::new();
        component.poll(&mut context, &mut |frame| {
            let id = u32::from_le_bytes([frame[7], frame[8], frame[9], 0]);
            if id != PARAM_VALUE || !lost_out.takes_next() {
                sent.extend_from_slice(frame);
            }
        });
        while let Some(request) = component.take_request() {
            match request {
                Request::ParamsChanged => changed = Some(Instant::now()),
                Request::Save => {
                    saves += 1;
                    component.storage_done(behaviour.storage_fault.map_or(Ok(()), Err));
                }
                other => panic!("siskin asked for {other:?}"),
            }
        }
        if stream.write_all(&sent).is_err() {
            client = None;
        }
    }
    Outcome { params, saves }
}
