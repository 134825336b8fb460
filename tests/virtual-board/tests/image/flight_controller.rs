//! A flight controller's end of the throttle wire: it sends bidirectional DShot, and reads the replies off the
//! line in the two ways that flight controllers use. Betaflight's bit-banged ports sample it three times per
//! bit; its other ports, and ArduPilot's, capture the times of its edges. None of Siskin's own decoders is used
//! here, neither their tables nor their tolerances.

use siskin_emulator::machine::Machine;

use crate::common::Board;

/// Bits of a frame.
const FRAME_BITS: f64 = 16.0;

/// From a frame's end to its reply, ns.
pub(crate) const DELAY_NS: f64 = 30_000.0;

/// Bits of a reply: a low start bit, then the word.
const REPLY_BITS: u32 = 21;

/// How long sampling lasts after the delay: a reply and a margin of 9 samples, 140 samples in all at DShot600,
/// as many as Betaflight takes.
const SAMPLES_A_BIT: f64 = 3.0;
const MARGIN_SAMPLES: f64 = 9.0;

/// Samples from the first low one in which edges are looked for: two bits more than a reply has.
const LONGEST_SAMPLES: usize = 3 * (REPLY_BITS as usize + 2);

/// A capture timer's ticks per reply bit.
const TICKS_A_BIT: f64 = 16.0;

/// Five bits on the line for each four of the word.
const QUINTETS: [u32; 16] = [
    0x19, 0x1b, 0x12, 0x13, 0x1d, 0x15, 0x16, 0x17, 0x1a, 0x09, 0x0a, 0x0b, 0x1e, 0x0d, 0x0e, 0x0f,
];

/// A datagram of raw levels on the wire (`emulator/README.md`).
const RAW: u8 = 255;

/// Frames put on the wire at once: they may wait for no longer than 100 ms.
const FRAMES_AT_ONCE: usize = 32;

/// A flight controller.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FlightController {
    /// Bit rate at which it sends.
    pub(crate) bit_hz: f64,
}

/// A frame and what was read of its reply.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Exchange {
    /// When the line first fell after the frame, ns.
    pub(crate) at_ns: Option<u64>,
    /// From the frame's end to then, ns.
    pub(crate) after_ns: Option<f64>,
    /// The word, from samples and from edges.
    pub(crate) sampled: Option<u16>,
    pub(crate) timed: Option<u16>,
}

/// What a word says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Told {
    Stopped,
    /// The electrical period, and the step to the next longer one, µs.
    Turn {
        period_us: u32,
        step_us: u32,
    },
    /// Extended telemetry.
    Extended {
        kind: u8,
        value: u8,
    },
}

impl FlightController {
    /// Returns the length of a frame, ns.
    fn frame_ns(&self) -> f64 {
        FRAME_BITS * 1e9 / self.bit_hz
    }

    /// Returns the bit rate that it reads.
    fn reply_hz(&self) -> f64 {
        self.bit_hz * 5.0 / 4.0
    }

    /// Sends `frames` frames with this value, each `apart_ns` after the previous one, and reads the replies.
    pub(crate) fn fly(
        &self,
        board: &mut Board,
        value: u16,
        frames: usize,
        apart_ns: impl Fn(usize) -> f64,
    ) -> Vec<Exchange> {
        board.heard.scope = Some(Default::default());
        let mut due_ns = board.now_ns() as f64 + 100_000.0;
        let datagram = self.frame(value);
        let mut sent_ns = Vec::with_capacity(frames);
        for frame in 0..frames {
            let at_ns = due_ns.ceil() as u64;
            board.board.wire(0).play(at_ns, &datagram).expect("a frame");
            sent_ns.push(at_ns);
            due_ns += apart_ns(frame);
            if frame % FRAMES_AT_ONCE == FRAMES_AT_ONCE - 1 || frame == frames - 1 {
                board.advance(due_ns.ceil() as u64);
            }
        }
        let line = &board.heard.scope.as_ref().expect("it was begun").line;
        let mut exchanges = Vec::with_capacity(frames);
        for (frame, &at_ns) in sent_ns.iter().enumerate() {
            let next_ns = sent_ns.get(frame + 1).map_or(u64::MAX, |next| *next);
            let [begin, end] = [at_ns, next_ns].map(|ns| line.partition_point(|edge| edge.0 < ns));
            exchanges.push(self.read(frame, &line[begin..end]));
        }
        exchanges
    }

    /// Returns a frame as raw levels, timed independently: a zero is low for 3/8 of a bit, a one for 6/8.
    fn frame(&self, value: u16) -> Vec<u8> {
        let word = value << 1;
        let bits = word << 4 | !(word ^ word >> 4 ^ word >> 8) & 0xf;
        let mut datagram = vec![RAW, 0];
        let mut begun_ns = 0;
        for bit in 0..16 {
            let low = if bits << bit & 0x8000 == 0 { 3 } else { 6 };
            for eighths in [8 * bit + low, 8 * bit + 8] {
                let until_ns = (f64::from(eighths) / 8.0 * 1e9 / self.bit_hz).round() as u32;
                datagram.extend((until_ns - begun_ns).to_le_bytes());
                begun_ns = until_ns;
            }
        }
        datagram
    }

    /// Reads the reply to a frame, from edges that begin with the frame's.
    fn read(&self, frame: usize, edges: &[(u64, bool)]) -> Exchange {
        let Some(&(first_ns, _)) = edges.first() else {
            return Exchange::NONE;
        };
        let end_ns = first_ns as f64 + self.frame_ns();
        // Its own last edge is a quarter of a bit earlier.
        let own = edges.partition_point(|edge| (edge.0 as f64) < end_ns - 0.1e9 / self.bit_hz);
        let reply = &edges[own..];
        let first = reply.iter().find(|edge| !edge.1);
        Exchange {
            at_ns: first.map(|edge| edge.0),
            after_ns: first.map(|edge| edge.0 as f64 - end_ns),
            sampled: self.sample(frame, reply, end_ns).and_then(word),
            timed: self.capture(reply).and_then(word),
        }
    }

    /// Samples the line from the frame's end; returns the reply's bits. The phase of the samples and the error
    /// of its clock, within 1 %, differ in each frame.
    fn sample(&self, frame: usize, reply: &[(u64, bool)], end_ns: f64) -> Option<u32> {
        let phase = (frame as f64 * 0.618_034).fract();
        let clock = 1.0 + 0.02 * ((frame as f64 * 0.754_878).fract() - 0.5);
        let sample_hz = clock * SAMPLES_A_BIT * self.reply_hz();
        let count = DELAY_NS * 1e-9 * SAMPLES_A_BIT * self.reply_hz()
            + SAMPLES_A_BIT * f64::from(REPLY_BITS)
            + MARGIN_SAMPLES;
        let level = |sample: usize| {
            let at_ns = end_ns + (sample as f64 + phase) * 1e9 / sample_hz;
            let passed = reply.partition_point(|edge| edge.0 as f64 <= at_ns);
            passed == 0 || reply[passed - 1].1
        };
        let samples: Vec<bool> = (0..count as usize).map(level).collect();
        let first = samples.iter().position(|level| !level)?;
        let last = samples.len().min(first + LONGEST_SAMPLES);
        let mut runs: Vec<_> = samples[first..last].chunk_by(|a, b| a == b).collect();
        // The line rests after the reply: its last level lasts for whatever is left.
        runs.pop();
        assembled(runs.into_iter().map(|run| (run.len() as u32 + 1) / 3))
    }

    /// Captures the times of the line's edges; returns the reply's bits.
    fn capture(&self, reply: &[(u64, bool)]) -> Option<u32> {
        let ticks = |ns: u64| (ns as f64 * 1e-9 * TICKS_A_BIT * self.reply_hz()) as u64;
        let falls = reply.iter().position(|edge| !edge.1)?;
        let lengths = reply[falls..].windows(2).map(|pair| {
            let passed = ticks(pair[1].0) - ticks(pair[0].0);
            ((passed as f64 + TICKS_A_BIT / 2.0) / TICKS_A_BIT) as u32
        });
        assembled(lengths)
    }
}

impl Exchange {
    const NONE: Self = Self {
        at_ns: None,
        after_ns: None,
        sampled: None,
        timed: None,
    };

    /// Returns the word, if both ways read the same one.
    pub(crate) fn word(&self) -> Option<u16> {
        self.sampled.filter(|word| self.timed == Some(*word))
    }
}

/// Assembles bits from the lengths of all levels except the last: each is a one followed by zeros.
fn assembled(lengths: impl Iterator<Item = u32>) -> Option<u32> {
    let (mut bits, mut value) = (0, 0_u32);
    for length in lengths {
        let length = length.max(1);
        bits += length;
        if bits > REPLY_BITS {
            return None;
        }
        value = value << length | 1 << (length - 1);
    }
    // What is left is the last level, high in every reply and no longer than three bits.
    let left = REPLY_BITS - bits;
    (1..=3)
        .contains(&left)
        .then(|| value << left | 1 << (left - 1))
}

/// Returns the 12 bits of a reply whose five-bit groups and checksum are right.
fn word(reply: u32) -> Option<u16> {
    let mut data = 0;
    for group in (0..4).rev() {
        let quintet = reply >> (5 * group) & 0x1f;
        let nibble = QUINTETS.iter().position(|own| *own == quintet)?;
        data = data << 4 | nibble as u16;
    }
    let sum = data ^ data >> 4 ^ data >> 8 ^ data >> 12;
    (sum & 0xf == 0xf).then_some(data >> 4)
}

impl Told {
    pub(crate) fn of(word: u16) -> Self {
        let (kind, value) = ((word >> 8) as u8, word as u8);
        let (exponent, mantissa) = (word >> 9, word & 0x1ff);
        if word == 0xfff {
            Self::Stopped
        } else if kind & 1 == 0 && kind != 0 {
            Self::Extended { kind, value }
        } else {
            Self::Turn {
                period_us: u32::from(mantissa) << exponent,
                step_us: 1 << exponent,
            }
        }
    }
}

#[test]
fn known_replies_are_read() {
    let controller = FlightController { bit_hz: 600e3 };
    let bit_ns = 1e9 / controller.reply_hz();
    // By hand: 0x123 has the checksum f ^ 1 ^ 2 ^ 3; 123f becomes 11011 10010 10011 01111, and each one in that
    // toggles the line, starting from the low start bit.
    let levels = "0 10010 11100 11101 10101".replace(' ', "");
    assert_eq!(levels.len(), REPLY_BITS as usize);
    for frame in 0..1000 {
        let begin_ns = 5_000_000.0 + controller.frame_ns() + DELAY_NS;
        let mut edges = vec![(5_000_000, false), (5_000_100, true)];
        let mut before = '1';
        for (bit, level) in levels.chars().chain("1".chars()).enumerate() {
            if level != before {
                edges.push(((begin_ns + bit as f64 * bit_ns) as u64, level == '1'));
            }
            before = level;
        }
        let read = controller.read(frame, &edges);
        assert_eq!(
            (read.sampled, read.timed),
            (Some(0x123), Some(0x123)),
            "{frame}"
        );
        assert!((read.after_ns.unwrap() - DELAY_NS).abs() < 2.0);
    }
}
