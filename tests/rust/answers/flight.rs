//! A flight controller that sends frames at a steady rate, and everything that comes back.

use siskin_control::drive::Snapshot;
use siskin_emulator::device::{Device, Onlooker, Start};
use siskin_emulator::rig::{Period, Rig};
use siskin_params::{BOSSO_BENCH, ParamId};

use super::reply::{Reply, levels};

/// A bidirectional rate with its protocol number on the emulator's wire.
#[derive(Clone, Copy, Debug)]
pub(super) struct Kind {
    pub(super) protocol: u8,
    pub(super) bit_hz: f64,
    /// Frame interval, ns: slightly longer than a frame, its reply and two rests.
    pub(super) interval_ns: u64,
}

pub(super) const KINDS: [Kind; 4] = [
    kind(20, 150e3, 300_000),
    kind(21, 300e3, 160_000),
    DSHOT600,
    kind(23, 1200e3, 80_000),
];

/// Frames at 8 kHz.
pub(super) const DSHOT600: Kind = kind(22, 600e3, 125_000);

const fn kind(protocol: u8, bit_hz: f64, interval_ns: u64) -> Kind {
    Kind {
        protocol,
        bit_hz,
        interval_ns,
    }
}

/// The answer to one frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Answered {
    pub(super) reply: Reply,
    /// The control's snapshot when it answered.
    pub(super) snapshot: Snapshot,
    /// The motor's true speed then, electrical turns per second.
    pub(super) true_hz: f64,
}

/// What the onlooker sees in one interval.
#[derive(Default)]
struct Seen {
    edges: Vec<(u64, bool)>,
    latest: Option<(Snapshot, f64)>,
    /// Replies, with what was known when they were given.
    replies: Vec<(Vec<u8>, Snapshot, f64)>,
    serial: Vec<Vec<u8>>,
}

impl Onlooker for Seen {
    fn period(&mut self, _t_s: f64, period: &Period, rig: &Rig) {
        let pole_pairs = f64::from(rig.config().scale.pole_pairs);
        let true_hz = period.rpm() / 60.0 * pole_pairs;
        self.latest = Some((rig.snapshot(), true_hz));
    }

    fn edge(&mut self, time_ns: u64, level: bool) {
        self.edges.push((time_ns, level));
    }

    fn answer(&mut self, _: u64, datagram: &[u8]) {
        if datagram[0] >= 30 {
            self.serial.push(datagram.to_vec());
            return;
        }
        let (snapshot, true_hz) = self.latest.expect("a period has passed");
        self.replies.push((datagram.to_vec(), snapshot, true_hz));
    }
}

pub(super) struct Flight {
    pub(super) device: Device,
    kind: Kind,
    /// The flight controller's clock.
    now_ns: u64,
    seen: Seen,
}

impl Flight {
    pub(super) fn new(kind: Kind, overrides: &[(ParamId, f32)]) -> Self {
        let (device, _) = Device::start(Start {
            overrides: [BOSSO_BENCH.settings, overrides].concat(),
            ..Start::default()
        })
        .expect("the parameters fit the bench");
        let mut flight = Self {
            device,
            kind,
            now_ns: 0,
            seen: Seen::default(),
        };
        // The line settles at its high rest level.
        flight.raw(1, &[900_000]);
        flight
    }

    /// Plays raw levels of less than a millisecond, and lets that millisecond pass.
    pub(super) fn raw(&mut self, first: u8, durations_ns: &[u32]) {
        let mut datagram = vec![255, first];
        datagram.extend(durations_ns.iter().flat_map(|d| d.to_le_bytes()));
        self.play(&datagram);
        self.wait(1_000_000);
        self.seen = Seen {
            latest: self.seen.latest,
            ..Seen::default()
        };
    }

    fn play(&mut self, datagram: &[u8]) {
        let played = self.device.wire().play(self.now_ns, datagram);
        played.expect("there is room");
    }

    fn wait(&mut self, for_ns: u64) {
        self.now_ns += for_ns;
        let seen = &mut self.seen;
        self.device
            .advance(self.now_ns, |_, _| None, seen, &mut |_| {});
    }

    /// Sends `frames` frames and then skips one; returns the answer to each, if any.
    pub(super) fn fly(
        &mut self,
        frames: usize,
        value: u16,
        telemetry: bool,
    ) -> Vec<Option<Answered>> {
        let data = value << 1 | u16::from(telemetry);
        let sum = !(data ^ data >> 4 ^ data >> 8) & 0xF;
        let [low, high] = (data << 4 | sum).to_le_bytes();
        let begin_ns = self.now_ns;
        for _ in 0..frames {
            self.play(&[self.kind.protocol, low, high]);
            self.wait(self.kind.interval_ns);
        }
        // Long enough to hear replies that are late by a control period.
        self.wait(self.kind.interval_ns);
        let mut edges = std::mem::take(&mut self.seen.edges).into_iter().peekable();
        let mut replies = std::mem::take(&mut self.seen.replies).into_iter();
        let frames = (0..frames as u64).map(|place| {
            let start_ns = begin_ns + place * self.kind.interval_ns;
            let mut own = Vec::new();
            while let Some(edge) = edges.next_if(|edge| edge.0 < start_ns + self.kind.interval_ns) {
                own.push(edge);
            }
            assert_eq!(own[0], (start_ns, false));
            if own.len() == 32 {
                // Only the frame is on the wire.
                return None;
            }
            let (datagram, snapshot, true_hz) = replies.next().expect("a datagram a reply");
            Some(Answered {
                reply: self.read(&datagram, &own),
                snapshot,
                true_hz,
            })
        });
        let answers = frames.collect();
        assert_eq!(replies.next(), None, "one datagram a reply");
        answers
    }

    /// Sends `frames` frames, each of which must be answered.
    pub(super) fn send(&mut self, frames: usize, value: u16) -> Vec<Answered> {
        let answers = self.fly(frames, value, false).into_iter();
        let answers = answers.collect::<Option<_>>();
        answers.expect("every frame is answered")
    }

    /// Returns what has come on the serial line.
    pub(super) fn serial(&self) -> &[Vec<u8>] {
        &self.seen.serial
    }

    /// Returns the number of frames in this many seconds.
    pub(super) fn frames(&self, seconds: f64) -> usize {
        (seconds * 1e9) as usize / self.kind.interval_ns as usize
    }

    /// Reads a reply, its start and its bit time from the levels on the wire, and checks that the datagram
    /// says the same.
    fn read(&self, datagram: &[u8], edges: &[(u64, bool)]) -> Reply {
        assert_eq!((datagram[0], datagram.len()), (self.kind.protocol, 9));
        let word = |place: usize| {
            let bytes = datagram[place..place + 4].try_into().expect("four bytes");
            u32::from_le_bytes(bytes)
        };
        let end_ns = edges[0].0 as f64 + 16e9 / self.kind.bit_hz;
        let (begins_ns, level) = edges[32];
        assert!(!level, "the line rests high");
        let after_ns = begins_ns as f64 - end_ns;
        assert!((after_ns - 30_000.0).abs() <= 1000.0, "{after_ns} ns");
        assert!((f64::from(word(5)) - after_ns).abs() <= 10.0, "{}", word(5));

        let bit_ns = 1e9 / (self.kind.bit_hz * 1.25);
        let level_at = |bit: usize| {
            let middle_ns = begins_ns as f64 + (bit as f64 + 0.5) * bit_ns;
            let before = edges
                .iter()
                .rfind(|(time_ns, _)| *time_ns as f64 <= middle_ns);
            before.expect("it has begun").1
        };
        let on_the_wire: Vec<bool> = (0..21).map(level_at).collect();
        assert_eq!(levels(word(1)), on_the_wire);
        assert!(edges.last().expect("not empty").1, "the line is left high");
        Reply::of_levels(&on_the_wire)
    }
}
