//! A flight controller with a clock of its own, and an ESC on the emulator's bench: frames and pulses go out
//! when due, and replies, texts and speeds come back.

use mavlink::dialects::ardupilotmega::{MavMessage, STATUSTEXT_DATA};
use mavlink::{MavlinkVersion, Message, MessageData};
use siskin_control::drive::Setpoint;
use siskin_emulator::device::{Device, Onlooker, Start};
use siskin_emulator::rig::{Period, Rig};
use siskin_params::{BOSSO_BENCH, ParamId};
use siskin_throttle::answer::gcr;
use siskin_units::Speed;

/// Protocol numbers of the wire's datagrams.
const SERVO: u8 = 0;
const BIDIRECTIONAL_DSHOT600: u8 = 22;

const BEACONS: core::ops::RangeInclusive<u16> = 1..=5;

pub(super) const STOP: u16 = 0;

/// Everything that comes back.
#[derive(Default)]
struct Seen {
    /// The data in each reply.
    replies: Vec<u16>,
    rpm: f64,
    /// Whether a tone was played.
    tone: bool,
    texts: Vec<String>,
}

impl Onlooker for Seen {
    fn period(&mut self, _: f64, period: &Period, _: &Rig) {
        self.rpm = period.rpm();
        self.tone |= matches!(period.setpoint, Setpoint::Tone(pitch) if pitch != Speed::ZERO);
    }

    fn answer(&mut self, _: u64, datagram: &[u8]) {
        if datagram[0] != BIDIRECTIONAL_DSHOT600 {
            return;
        }
        let levels = u32::from_le_bytes(datagram[1..5].try_into().expect("four bytes"));
        self.replies
            .push(gcr::decode(levels).expect("a whole reply"));
    }

    fn frame(&mut self, _: u64, raw: &[u8]) {
        let id = u32::from_le_bytes([raw[7], raw[8], raw[9], 0]);
        if id != STATUSTEXT_DATA::ID {
            return;
        }
        let payload = &raw[10..][..usize::from(raw[1])];
        if let Ok(MavMessage::STATUSTEXT(text)) = MavMessage::parse(MavlinkVersion::V2, id, payload)
        {
            self.texts.push(text.text.to_str().expect("ASCII").into());
        }
    }
}

pub(super) struct FlightController {
    device: Device,
    now_ns: u64,
    seen: Seen,
}

impl FlightController {
    /// Creates one whose ESC has just been powered up.
    pub(super) fn new(overrides: &[(ParamId, f32)]) -> Self {
        let (device, warning) = Device::start(Start {
            overrides: [BOSSO_BENCH.settings, overrides].concat(),
            ..Start::default()
        })
        .expect("the parameters fit the bench");
        assert_eq!(warning, None);
        Self {
            device,
            now_ns: 0,
            seen: Seen::default(),
        }
    }

    /// Creates one whose ESC has been armed by zero throttle, with its tunes over.
    pub(super) fn armed(overrides: &[(ParamId, f32)]) -> Self {
        let mut fc = Self::new(overrides);
        fc.frames(1_500, STOP);
        assert!(fc.is_armed());
        fc.seen = Seen::default();
        fc
    }

    /// Lets time pass.
    pub(super) fn wait_us(&mut self, us: u64) {
        self.now_ns += us * 1_000;
        let seen = &mut self.seen;
        self.device
            .advance(self.now_ns, |_, _| None, seen, &mut |_| {});
    }

    fn play(&mut self, datagram: &[u8]) {
        let played = self.device.wire().play(self.now_ns, datagram);
        played.expect("there is room");
    }

    /// Sends servo pulses, 50 a second.
    pub(super) fn pulses(&mut self, ms: u64, width_us: u32) {
        for _ in 0..ms / 20 {
            let mut datagram = vec![SERVO];
            datagram.extend((width_us * 1_000).to_le_bytes());
            self.play(&datagram);
            self.wait_us(20_000);
        }
    }

    /// Sends any word at bidirectional DShot600, and waits until the next is due.
    pub(super) fn word(&mut self, word: u16, us: u64) {
        let [low, high] = word.to_le_bytes();
        self.play(&[BIDIRECTIONAL_DSHOT600, low, high]);
        self.wait_us(us);
    }

    /// Sends frames of one value, 1 ms apart.
    pub(super) fn frames(&mut self, count: u32, value: u16) {
        for _ in 0..count {
            self.word(frame(value), 1_000);
        }
    }

    /// Sends a command as Betaflight does while its loop blocks: after a 10 ms pause, a beacon once and
    /// others ten times, with a pause after beacons.
    pub(super) fn blocking(&mut self, command: u16) {
        self.wait_us(10_000);
        if BEACONS.contains(&command) {
            self.word(frame(command), 100_100);
        } else {
            self.frames(10, command);
        }
    }

    /// Returns whether the motor has sounded a tone since the last call.
    pub(super) fn heard(&mut self) -> bool {
        core::mem::take(&mut self.seen.tone)
    }

    /// Returns the data of the replies since the last call.
    pub(super) fn replies(&mut self) -> Vec<u16> {
        core::mem::take(&mut self.seen.replies)
    }

    pub(super) fn said(&self, text: &str) -> bool {
        self.seen.texts.iter().any(|said| said == text)
    }

    /// Returns the shaft's true speed.
    pub(super) fn rpm(&self) -> f64 {
        self.seen.rpm
    }

    pub(super) fn is_armed(&self) -> bool {
        self.device.esc().telemetry().armed
    }

    pub(super) fn param(&self, id: ParamId) -> f32 {
        self.device.esc().params().get(id)
    }
}

/// Returns a frame's 16 bits, with the inverted checksum of a bidirectional wire.
pub(super) fn frame(value: u16) -> u16 {
    let data = value << 1;
    data << 4 | !(data ^ data >> 4 ^ data >> 8) & 0xF
}
