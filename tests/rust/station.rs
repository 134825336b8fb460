//! An emulated ESC with a ground station.

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd, MavMessage, MavResult};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message, MessageData};
use siskin_control::drive::Setpoint;
use siskin_control::mavlink::Receiver;
use siskin_emulator::device::{Device, Start};
use siskin_emulator::link::LinkId;
use siskin_emulator::rig::{Period, Rig};

const MS_NS: u64 = 1_000_000;
/// Zero and half throttle in a DShot frame.
pub(crate) const ZERO: u16 = 0;
pub(crate) const HALF: u16 = 1048;

/// An ESC, and a ground station that listens to it.
pub(crate) struct Station {
    pub(crate) device: Device,
    listener: Receiver,
    /// Results of commands, with their percentages.
    pub(crate) acks: Vec<(MavResult, u8)>,
    pub(crate) texts: Vec<String>,
    /// Highest shaft speed, rpm, and largest phase current, A.
    pub(crate) rpm: f64,
    pub(crate) current_a: f64,
    /// Periods in which a self-test has pulled a leg.
    pub(crate) pulls: usize,
}

impl Station {
    /// Creates one that has been on for a second.
    pub(crate) fn new(start: Start) -> Self {
        let (device, warning) = Device::start(Start {
            link_bytes_per_s: 1_000_000,
            ..start
        })
        .expect("it starts");
        assert_eq!(warning, None);
        let mut station = Self {
            device,
            listener: Receiver::default(),
            acks: Vec::new(),
            texts: Vec::new(),
            rpm: 0.0,
            current_a: 0.0,
            pulls: 0,
        };
        station.run(1000, None);
        station.texts.clear();
        station.rpm = 0.0;
        station.current_a = 0.0;
        station
    }

    /// Runs for `count_ms`, with a frame of this throttle, if any, each millisecond.
    pub(crate) fn run(&mut self, count_ms: u64, throttle: Option<u16>) {
        for _ in 0..count_ms {
            let now_ns = self.device.now_ns();
            if let Some(throttle) = throttle {
                let data = throttle << 1;
                let bits = data << 4 | (data ^ data >> 4 ^ data >> 8) & 0xF;
                let [low, high] = bits.to_le_bytes();
                let wire = self.device.wire();
                wire.play(now_ns, &[12, low, high]).expect("there is room");
            }
            let Self {
                device,
                listener,
                acks,
                texts,
                rpm,
                current_a,
                pulls,
            } = self;
            let mut onlooker = |_: f64, period: &Period, _: &Rig| {
                *rpm = rpm.max(period.rpm().abs());
                for current in period.motion.currents_a {
                    *current_a = current_a.max(current.abs());
                }
                *pulls += usize::from(matches!(period.setpoint, Setpoint::Pull(_)));
            };
            let mut send = |frame: &[u8]| {
                listener.push(now_ns / 1000, frame, |frame| {
                    match MavMessage::parse(MavlinkVersion::V2, frame.id, frame.payload) {
                        Ok(MavMessage::COMMAND_ACK(_)) => {
                            let result = frame.payload[2];
                            let result = [
                                MavResult::MAV_RESULT_ACCEPTED,
                                MavResult::MAV_RESULT_TEMPORARILY_REJECTED,
                                MavResult::MAV_RESULT_FAILED,
                                MavResult::MAV_RESULT_IN_PROGRESS,
                            ]
                            .into_iter()
                            .find(|of| *of as u8 == result)
                            .expect("one of these");
                            // Trailing zero bytes are not sent.
                            acks.push((result, frame.payload.get(3).copied().unwrap_or(0)));
                        }
                        Ok(MavMessage::STATUSTEXT(text)) => {
                            texts.push(text.text.to_str().expect("ASCII").to_owned());
                        }
                        _ => {}
                    }
                });
            };
            device.advance(now_ns + MS_NS, |_, _| None, &mut onlooker, &mut send);
        }
    }

    /// Sends a command with its first parameter.
    pub(crate) fn ask(&mut self, command: MavCmd, param1: f32) {
        self.send(&COMMAND_LONG_DATA {
            command,
            param1,
            target_system: 1,
            target_component: 1,
            ..COMMAND_LONG_DATA::default()
        });
    }

    /// Sends a message.
    pub(crate) fn send(&mut self, message: &impl MessageData) {
        let mut raw = MAVLinkV2MessageRaw::new();
        let header = MavHeader {
            system_id: 255,
            component_id: 190,
            sequence: 0,
        };
        raw.serialize_message_data(header, message);
        let mut nobody = |_: f64, _: &Period, _: &Rig| {};
        self.device
            .receive(LinkId::default(), raw.raw_bytes(), &mut nobody);
    }
}
