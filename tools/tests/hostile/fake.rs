//! An ESC that says what it should not: heartbeats, and whatever a test answers, on a loopback TCP port.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use mavlink::dialects::ardupilotmega::{
    COMMAND_ACK_DATA, COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA, HEARTBEAT_DATA, MavAutopilot,
    MavCmd, MavResult, MavSeverity, MavType, STATUSTEXT_DATA,
};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, MessageData};
use siskin_control::mavlink::{Frame, Receiver};

/// What it sends.
pub(crate) type Out = Vec<u8>;

/// Answers one frame.
pub(crate) type Answer = Box<dyn FnMut(&Frame, &mut Out) + Send>;

/// A running one, which ends when it is dropped.
pub(crate) struct Fake {
    pub(crate) endpoint: String,
    stopping: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Fake {
    /// Starts one; `later` is sent once, so long after the first frame that is not a heartbeat.
    pub(crate) fn start(mut answer: Answer, later: Option<(Duration, Out)>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free loopback port");
        let endpoint = format!("tcp:{}", listener.local_addr().expect("bound"));
        let stopping = Arc::new(AtomicBool::new(false));
        let stop = Arc::clone(&stopping);
        let thread = thread::spawn(move || serve(&listener, &mut answer, later, &stop));
        Self {
            endpoint,
            stopping,
            thread: Some(thread),
        }
    }
}

impl Drop for Fake {
    fn drop(&mut self) {
        self.stopping.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(matches!(ended, Some(Ok(()))) || thread::panicking());
    }
}

fn serve(
    listener: &TcpListener,
    answer: &mut Answer,
    mut later: Option<(Duration, Out)>,
    stop: &AtomicBool,
) {
    let (mut stream, _) = listener.accept().expect("siskin connects");
    let wait = Some(Duration::from_millis(1));
    stream.set_read_timeout(wait).expect("a socket");
    let mut receiver = Receiver::new();
    let started = Instant::now();
    let mut begun = None;
    let mut beaten: Option<Instant> = None;
    let mut buffer = [0; 4096];
    while !stop.load(Ordering::Relaxed) {
        let mut out = Out::new();
        if beaten.is_none_or(|at| at.elapsed() > Duration::from_millis(300)) {
            beaten = Some(Instant::now());
            push(&mut out, &heartbeat());
        }
        let read = match stream.read(&mut buffer) {
            Ok(0) => return,
            Ok(read) => read,
            Err(_) => 0,
        };
        let now_us = u64::try_from(started.elapsed().as_micros()).expect("short");
        receiver.push(now_us, &buffer[..read], |frame| {
            if frame.id != HEARTBEAT_DATA::ID {
                begun = begun.or_else(|| Some(Instant::now()));
                answer(frame, &mut out);
            }
        });
        if let (Some(at), Some((wait, _))) = (begun, &later)
            && at.elapsed() >= *wait
        {
            out.extend(later.take().into_iter().flat_map(|(_, sent)| sent));
        }
        if stream.write_all(&out).is_err() {
            return;
        }
    }
}

fn heartbeat() -> HEARTBEAT_DATA {
    HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_GENERIC,
        autopilot: MavAutopilot::MAV_AUTOPILOT_GENERIC,
        ..HEARTBEAT_DATA::DEFAULT
    }
}

/// Appends a frame of system 1, component 1.
pub(crate) fn push(out: &mut Out, message: &impl MessageData) {
    let mut frame = MAVLinkV2MessageRaw::new();
    let header = MavHeader {
        system_id: 1,
        component_id: 1,
        sequence: 0,
    };
    frame.serialize_message_data(header, message);
    out.extend(frame.raw_bytes());
}

/// Appends an acknowledgement.
pub(crate) fn ack(out: &mut Out, command: MavCmd, result: MavResult) {
    push(out, &COMMAND_ACK_DATA { command, result });
}

/// Appends a text.
pub(crate) fn text(out: &mut Out, text: &str) {
    push(
        out,
        &STATUSTEXT_DATA {
            severity: MavSeverity::MAV_SEVERITY_WARNING,
            text: text.into(),
        },
    );
}

/// Returns a command and its first parameter.
pub(crate) fn command(frame: &Frame) -> Option<(MavCmd, f32)> {
    let is_command = frame.id == COMMAND_LONG_DATA::ID;
    let data = is_command.then(|| COMMAND_LONG_DATA::deser(MavlinkVersion::V2, frame.payload));
    data.and_then(Result::ok)
        .map(|data| (data.command, data.param1))
}

/// Answers a request for a file, of which `piece` returns the bytes from an offset on; an empty piece is its end.
pub(crate) fn file(frame: &Frame, out: &mut Out, piece: impl Fn(usize) -> Vec<u8>) {
    const READ: u8 = 5;
    const ACK: u8 = 128;
    const NAK: u8 = 129;
    const END_OF_FILE: u8 = 6;
    if frame.id != FILE_TRANSFER_PROTOCOL_DATA::ID {
        return;
    }
    let request = FILE_TRANSFER_PROTOCOL_DATA::deser(MavlinkVersion::V2, frame.payload)
        .expect("siskin's")
        .payload;
    let mut payload = [0; 251];
    let sequence = u16::from_le_bytes([request[0], request[1]]).wrapping_add(1);
    payload[..2].copy_from_slice(&sequence.to_le_bytes());
    payload[5] = request[3];
    payload[3] = ACK;
    if request[3] == READ {
        let offset = u32::from_le_bytes([request[8], request[9], request[10], request[11]]);
        let mut data = piece(usize::try_from(offset).expect("short"));
        if data.is_empty() {
            payload[3] = NAK;
            data.push(END_OF_FILE);
        }
        payload[4] = u8::try_from(data.len()).expect("a piece");
        payload[12..][..data.len()].copy_from_slice(&data);
    }
    push(
        out,
        &FILE_TRANSFER_PROTOCOL_DATA {
            target_network: 0,
            target_system: 255,
            target_component: 190,
            payload,
        },
    );
}
