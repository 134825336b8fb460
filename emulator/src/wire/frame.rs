//! One datagram of the throttle wire as levels over time.

use siskin_control::answer::{REPLY_DELAY_NS, gcr, reply_bit_hz};
use siskin_control::input::dshot::{Rate, edges};
use siskin_control::input::signal::Signal;

use super::rejected::Rejected;

/// The longest run of levels that is played, ns. It is far above any frame's, and bounds for how
/// long one datagram can hold the wire.
const MAX_DURATION_NS: u64 = 10_000_000_000;

/// The low level that keeps the shortest pulses apart, ns; longer ones get 1/16 of their width,
/// which leaves a 2 ms pulse its 450 Hz.
const MIN_PULSE_REST_NS: u64 = 2_000;

/// The least time from a pulse to the next, ns: Multishot's 32 kHz. A decoder takes pulses that
/// follow each other like DShot's bits for no pulses.
const MIN_PULSE_PERIOD_NS: u64 = 31_250;

/// Eighths of a bit of rest between two DShot frames. A decoder knows a frame's end by a level that
/// lasts longer than a bit; four bits leave no doubt and cost a fifth of the highest frame rate.
const DSHOT_REST_EIGHTHS: u32 = 4 * 8;

/// What a datagram puts on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Frame<'a> {
    /// High for a while.
    Pulse { width_ns: u64 },
    /// 16 bits, from the highest on.
    DShot {
        rate: Rate,
        bidirectional: bool,
        bits: u16,
    },
    /// Levels that alternate; four bytes say how long each lasts.
    Raw {
        first: bool,
        durations: &'a [[u8; 4]],
    },
}

impl<'a> Frame<'a> {
    /// Byte 0 is the protocol, then its payload, little-endian.
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
                // Frames have the numbers of `INP_PROTO`; pulses count from 0 here and from 1 there.
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

    /// What it asks for, 0 to 1 of its range; 0 of raw levels.
    pub(super) fn throttle(&self) -> f64 {
        let share = |value: f64, from: f64, to: f64| ((value - from) / (to - from)).clamp(0.0, 1.0);
        match *self {
            Self::DShot { bits, .. } => share(f64::from(bits >> 5), 47.0, 2047.0),
            Self::Pulse { width_ns } => {
                // Servo, OneShot125, OneShot42, Multishot: no two of them have a width in common.
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

    /// From the first edge to the end, ns: 16 bit times for DShot.
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

    /// Most edges that it can make, one that first brings the line to rest included.
    pub(super) fn max_edges(&self) -> usize {
        match self {
            Self::Pulse { .. } => 3,
            Self::DShot { .. } => 33,
            Self::Raw { durations, .. } => durations.len(),
        }
    }

    /// The level at which the line rests around it. Raw levels follow whatever there is.
    pub(super) fn idle_level(&self) -> Option<bool> {
        match self {
            Self::Pulse { .. } => Some(false),
            Self::DShot { bidirectional, .. } => Some(*bidirectional),
            Self::Raw { .. } => None,
        }
    }

    /// The rest that keeps it apart from what was before it, ns. Raw levels follow each other
    /// without any, so that a long capture can come in several datagrams.
    pub(super) fn rest_before_ns(&self) -> u64 {
        match *self {
            Self::Pulse { width_ns } => MIN_PULSE_REST_NS.max(width_ns / 16),
            Self::DShot { rate, .. } => rate.eighths_ns(DSHOT_REST_EIGHTHS).into(),
            Self::Raw { .. } => 0,
        }
    }

    /// The rest that it needs after it, ns: after a bidirectional frame the time of its answer too,
    /// and after a short pulse what is left of its period.
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
