//! Drives bytes in and reads bytes out.

mod commands;
mod files;
mod noise;
mod parameters;
mod receiving;
mod signals;
mod signing;
mod streams;

use mavlink::dialects::ardupilotmega::{COMMAND_ACK_DATA, MavMessage};
use mavlink::{
    MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message, MessageData, calculate_crc,
};
use std::vec::Vec;

use siskin_params::{BOSSO_BENCH, Board, Image, ParamId, Params};
use siskin_throttle::authority::{Authority, Timing};

use super::*;
use crate::build::BuildError;
use crate::check::Report;
use crate::drive::{Faults, Limits, Phase};
use crate::identify;
use crate::telemetry::{SIGNALS, Telemetry};

pub(super) const TELEMETRY: Telemetry = Telemetry {
    rpm: 0.0,
    bus_v: 24.0,
    bus_a: 0.0,
    consumed_mah: 0.0,
    temperature_c: 25.0,
    phase: Phase::Idle,
    faults: Faults::NONE,
    limits: Limits::NONE,
    fault_count: 0,
    failed_starts: 0,
    r_mohm: 0.0,
    flux_mwb: 0.0,
    armed: false,
    bad_frames: 0,
    bad_share: 0.0,
    signal: None,
    signals: [0.0; SIGNALS.len()],
    statistics: crate::statistics::Statistics::NONE,
};

/// The ground station of these tests.
const STATION: Address = Address {
    system: 255,
    component: 190,
};
const ESC: Address = Address {
    system: 1,
    component: 1,
};

/// A frame sent by the ESC.
#[derive(Clone, Debug)]
struct Sent {
    at_us: u64,
    sequence: u8,
    from: Address,
    message: MavMessage,
    /// Including omitted zeros, for what the generated types lack.
    payload: [u8; 255],
    len: usize,
}

/// An ESC and its surroundings.
struct Bench {
    now_us: u64,
    params: Params,
    telemetry: Telemetry,
    authority: Authority,
    receiver: Receiver,
    component: Component,
    link_bytes_per_s: u32,
}

impl Bench {
    fn new() -> Self {
        Self::with(Params::of(&BOSSO_BENCH), 1_000_000)
    }

    /// Creates a bench whose start text has been sent.
    fn with(params: Params, link_bytes_per_s: u32) -> Self {
        let mut bench = Self {
            now_us: 1_000_000,
            component: Component::new(&params, &Image::EMULATOR, link_bytes_per_s),
            params,
            telemetry: TELEMETRY,
            authority: Authority::new(Timing {
                arm_us: 300_000,
                loss_us: 100_000,
            }),
            receiver: Receiver::new(),
            link_bytes_per_s,
        };
        let start = bench.poll();
        assert!(texts(&start)[0].starts_with("Siskin ESC "));
        bench
    }

    fn receive(&mut self, bytes: &[u8]) {
        let Self {
            now_us,
            params,
            telemetry,
            authority,
            receiver,
            component,
            ..
        } = self;
        let check = Report::new(40.0, 0.02);
        let mut context = Context {
            now_us: *now_us,
            params,
            board: &Board::BENCH,
            telemetry,
            #[cfg(feature = "group")]
            four: None,
            check: &check,
            identification: &identify::Report::default(),
            record: None,
            authority,
            validate: &refuse_low_limit,
        };
        receiver.push(*now_us, bytes, |frame| {
            component.handle(frame, &mut context);
        });
    }

    fn poll(&mut self) -> Vec<Sent> {
        let mut frames = Vec::new();
        self.poll_bytes(&mut frames);
        let sent = frames.iter().map(|bytes| parse(self.now_us, bytes));
        sent.collect()
    }

    /// Collects the frames sent at this poll.
    fn poll_bytes(&mut self, frames: &mut Vec<Vec<u8>>) {
        let check = Report::new(40.0, 0.02);
        let mut context = Context {
            now_us: self.now_us,
            params: &mut self.params,
            board: &Board::BENCH,
            telemetry: &self.telemetry,
            #[cfg(feature = "group")]
            four: None,
            check: &check,
            identification: &identify::Report::default(),
            record: None,
            authority: &mut self.authority,
            validate: &refuse_low_limit,
        };
        self.component.poll(&mut context, &mut |bytes| {
            frames.push(bytes.to_vec());
        });
    }

    /// Sends a message to the ESC and returns its answers at the next poll, without what it sends
    /// by itself.
    fn ask<D: MessageData>(&mut self, data: &D) -> Vec<Sent> {
        self.receive(&encode(STATION, data, &[]));
        self.answers()
    }

    fn answers(&mut self) -> Vec<Sent> {
        let mut sent = self.poll();
        sent.retain(|sent| !is_stream(&sent.message));
        sent
    }

    /// Polls every millisecond for a time.
    fn run_ms(&mut self, ms: u64) -> Vec<Sent> {
        let mut sent = Vec::new();
        for _ in 0..ms {
            self.now_us += 1000;
            self.receive(&[]);
            sent.extend(self.poll());
        }
        sent
    }
}

/// A check like `build`'s: one parameter conflicts with another.
fn refuse_low_limit(params: &Params) -> Result<(), BuildError> {
    let low = params.get(ParamId::LimPhaseA) < 2.0;
    if low && params.get(ParamId::CtlBwCurHz) > 300.0 {
        return Err(BuildError {
            param: ParamId::CtlBwCurHz,
            reason: "too fast for so low a limit, lower it first",
        });
    }
    Ok(())
}

fn encode<D: MessageData>(from: Address, data: &D, extension: &[u8]) -> Vec<u8> {
    let mut raw = MAVLinkV2MessageRaw::new();
    let header = MavHeader {
        system_id: from.system.into(),
        component_id: from.component,
        sequence: 0,
    };
    raw.serialize_message_data(header, data);
    let mut payload = raw.payload().to_vec();
    if !extension.is_empty() {
        payload.resize(D::ENCODED_LEN, 0);
        payload.extend_from_slice(extension);
    }
    frame(from, (D::ID, D::EXTRA_CRC), 0, &payload)
}

fn frame(from: Address, (id, extra_crc): (u32, u8), flags: u8, payload: &[u8]) -> Vec<u8> {
    let [a, b, c, _] = id.to_le_bytes();
    let mut bytes = Vec::from([
        0xfd,
        payload.len() as u8,
        flags,
        0,
        0,
        from.system,
        from.component,
        a,
        b,
        c,
    ]);
    bytes.extend_from_slice(payload);
    let check = calculate_crc(&bytes[1..], extra_crc);
    bytes.extend_from_slice(&check.to_le_bytes());
    bytes
}

/// Parses a frame without the code under test.
fn parse(at_us: u64, bytes: &[u8]) -> Sent {
    let mut raw = MAVLinkV2MessageRaw::new();
    raw.as_mut_slice()[..bytes.len()].copy_from_slice(bytes);
    assert_eq!(raw.raw_bytes().len(), bytes.len());
    assert!(raw.has_valid_crc::<MavMessage>());
    let mut typed = raw.payload().to_vec();
    if raw.message_id() == COMMAND_ACK_DATA::ID {
        // The generated type rejects commands that it does not know; tests read the bytes.
        typed[0..2].fill(0);
        typed[0] = 176;
    }
    let message = MavMessage::parse(MavlinkVersion::V2, raw.message_id(), &typed);
    let mut payload = [0; 255];
    payload[..raw.payload().len()].copy_from_slice(raw.payload());
    Sent {
        at_us,
        sequence: raw.sequence(),
        from: Address {
            system: u8::try_from(raw.system_id()).expect("8 bits"),
            component: raw.component_id(),
        },
        message: message.expect("the dialect has it"),
        payload,
        len: bytes.len(),
    }
}

fn is_stream(message: &MavMessage) -> bool {
    matches!(
        message,
        MavMessage::HEARTBEAT(_)
            | MavMessage::ESC_INFO(_)
            | MavMessage::ESC_STATUS(_)
            | MavMessage::ESC_TELEMETRY_1_TO_4(_)
            | MavMessage::NAMED_VALUE_FLOAT(_)
    )
}

fn texts(sent: &[Sent]) -> Vec<&str> {
    sent.iter()
        .filter_map(|sent| match &sent.message {
            MavMessage::STATUSTEXT(text) => Some(text.text.to_str().expect("ASCII")),
            _ => None,
        })
        .collect()
}

/// Returns index and value of each PARAM_VALUE.
fn values(sent: &[Sent]) -> Vec<(u16, f32)> {
    sent.iter()
        .filter_map(|sent| match &sent.message {
            MavMessage::PARAM_VALUE(value) => Some((value.param_index, value.param_value)),
            _ => None,
        })
        .collect()
}

fn count(sent: &[Sent], id: u32) -> usize {
    sent.iter()
        .filter(|sent| sent.message.message_id() == id)
        .count()
}
