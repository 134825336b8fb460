//! One throttle-wire datagram as levels over time.

use siskin_throttle::answer::{REPLY_DELAY_NS, gcr, reply_bit_hz};
use siskin_throttle::dshot::{Rate, edges};
use siskin_throttle::signal::Signal;

use super::rejected::Rejected;

/// The longest run of levels, ns. It far exceeds any frame's, and bounds how long one datagram can
/// hold the wire.
const MAX_DURATION_NS: u64 = 10_000_000_000;

/// The low level that separates the shortest pulses, ns; longer ones get 1/16 of their width, which
/// allows a 2 ms pulse its 450 Hz.
const MIN_PULSE_REST_NS: u64 = 2_000;

/// Least period of pulses, ns: Multishot's 32 kHz. A decoder does not take pulses spaced like
/// DShot's bits for pulses.
const MIN_PULSE_PERIOD_NS: u64 = 31_250;

/// Rest between two DShot frames, in eighths of a bit. A decoder recognises a frame's end by a
/// level longer than a bit; four bits leave no doubt and cost a fifth of the highest frame rate.
const DSHOT_REST_EIGHTHS: u32 = 4 * 8;

/// What a datagram puts on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Frame<'a> {
    /// High for a while.
    Pulse { width_ns: u64 },
    /// 16 bits, most significant first.
    DShot {
        rate: Rate,
        bidirectional: bool,
        bits: u16,
    },
    /// Alternating levels; four bytes give each one's duration.
    Raw {
        first: bool,
        durations: &'a [[u8; 4]],
    },
}

impl<'a> Frame<'a> {
    /// Parses a datagram: byte 0 is the protocol, followed by its payload, little-endian.
    pub(super) fn parse(datagram: &'a [u8]) -> Result<Self, Rejected> {
        let (protocol, payload) = datagram.split_first().ok_or(Rejected::Empty)?;
        let wrong_length = || Rejected::Length {
            protocol: *protocol,
            length: datagram.len(),
        };
        let frame = match protocol {
            0..=3 => {
                let width = payload.try_into().map_err(|_| wrong_length())?;
                Self::Pulse {
                    width_ns: u32::from_le_bytes(width).into(),
                }
            }
            255 => {
                let (first, durations) = payload.split_first().ok_or_else(wrong_length)?;
                let (durations, rest) = durations.as_chunks();
                if !rest.is_empty() || durations.is_empty() {
                    return Err(wrong_length());
                }
                let first = match first {
                    0 => false,
                    1 => true,
                    level => return Err(Rejected::Level(*level)),
                };
                Self::Raw { first, durations }
            }
            number => {
                // Frames have the numbers of `INP_PROTO`; pulses count from 0 here and from 1
                // there.
                let Some(Signal::Dshot {
                    rate,
                    bidirectional,
                }) = Signal::from_number(*number)
                else {
                    return Err(Rejected::Protocol(*number));
                };
                let bits = payload.try_into().map_err(|_| wrong_length())?;
                Self::DShot {
                    rate,
                    bidirectional,
                    bits: u16::from_le_bytes(bits),
                }
            }
        };
        match frame.duration_ns() {
            0 if matches!(frame, Self::Pulse { .. }) => Err(Rejected::NoPulse),
            duration_ns if duration_ns > MAX_DURATION_NS => Err(Rejected::TooLong(duration_ns)),
            _ => Ok(frame),
        }
    }

    /// Returns its throttle, 0 to 1 of its range; 0 for raw levels.
    pub(super) fn throttle(&self) -> f64 {
        let share = |value: f64, from: f64, to: f64| ((value - from) / (to - from)).clamp(0.0, 1.0);
        match *self {
            Self::DShot { bits, .. } => share(f64::from(bits >> 5), 47.0, 2047.0),
            Self::Pulse { width_ns } => {
                // Servo, OneShot125, OneShot42, Multishot: their widths do not overlap.
                let ranges = [(1000.0, 2000.0), (125.0, 250.0), (42.0, 84.0), (5.0, 25.0)];
                let width_us = width_ns as f64 * 1e-3;
                let found = ranges.iter().find(|(from, _)| width_us > 0.7 * from);
                found.map_or(0.0, |(from, to)| share(width_us, *from, *to))
            }
            Self::Raw { .. } => 0.0,
        }
    }

    /// Calls `set` with the time from the frame's start, ns, and the level from then on.
    pub(super) fn levels(&self, mut set: impl FnMut(u64, bool)) {
        match *self {
            Self::Pulse { width_ns } => {
                set(0, true);
                set(width_ns, false);
            }
            Self::DShot {
                rate,
                bidirectional,
                bits,
            } => edges(bits, rate).for_each(|(time_ns, active)| {
                set(time_ns.into(), active != bidirectional);
            }),
            Self::Raw { first, durations } => {
                let (mut time_ns, mut level) = (0, first);
                for duration in durations {
                    set(time_ns, level);
                    time_ns += u64::from(u32::from_le_bytes(*duration));
                    level = !level;
                }
            }
        }
    }

    /// Returns the time from the first edge to the end, ns: 16 bit times for DShot.
    pub(super) fn duration_ns(&self) -> u64 {
        match *self {
            Self::Pulse { width_ns } => width_ns,
            Self::DShot { rate, .. } => rate.frame_ns().into(),
            Self::Raw { durations, .. } => durations
                .iter()
                .map(|duration| u64::from(u32::from_le_bytes(*duration)))
                .sum(),
        }
    }

    /// Returns the most edges that it can make, including one that first brings the line to rest.
    pub(super) fn max_edges(&self) -> usize {
        match self {
            Self::Pulse { .. } => 3,
            Self::DShot { .. } => 33,
            Self::Raw { durations, .. } => durations.len(),
        }
    }

    /// Returns the level at which the line rests around it. Raw levels follow any level.
    pub(super) fn idle_level(&self) -> Option<bool> {
        match self {
            Self::Pulse { .. } => Some(false),
            Self::DShot { bidirectional, .. } => Some(*bidirectional),
            Self::Raw { .. } => None,
        }
    }

    /// Returns the rest that separates it from what came before, ns. Raw levels need none, so that
    /// a long capture can come in several datagrams.
    pub(super) fn rest_before_ns(&self) -> u64 {
        match *self {
            Self::Pulse { width_ns } => MIN_PULSE_REST_NS.max(width_ns / 16),
            Self::DShot { rate, .. } => rate.eighths_ns(DSHOT_REST_EIGHTHS).into(),
            Self::Raw { .. } => 0,
        }
    }

    /// Returns the rest required after it, ns: after a bidirectional frame also the time of its
    /// answer, and after a short pulse the remainder of its period.
    pub(super) fn rest_after_ns(&self) -> u64 {
        let rest_ns = self.rest_before_ns();
        match *self {
            Self::Pulse { width_ns } => rest_ns.max(MIN_PULSE_PERIOD_NS.saturating_sub(width_ns)),
            Self::DShot {
                rate,
                bidirectional: true,
                ..
            } => {
                let reply_ns = u64::from(gcr::BITS) * 1_000_000_000 / u64::from(reply_bit_hz(rate));
                u64::from(REPLY_DELAY_NS) + reply_ns + rest_ns
            }
            _ => rest_ns,
        }
    }
}
