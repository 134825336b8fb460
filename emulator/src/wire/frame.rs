//! One datagram of the throttle wire as levels over time.

use super::Rejected;

/// The longest run of levels that is played, ns. It is far above any frame's, and bounds for how
/// long one datagram can hold the wire.
const MAX_DURATION_NS: u64 = 10_000_000_000;

/// The low level that keeps the shortest pulses apart, ns; longer ones get 1/16 of their width,
/// which leaves a 2 ms pulse its 450 Hz.
const MIN_PULSE_REST_NS: u64 = 2_000;

/// Bit times of rest between two DShot frames. A decoder knows a frame's end by a level that
/// lasts longer than a bit; four leave no doubt and cost a sixth of the highest frame rate.
const DSHOT_REST_BITS: u64 = 4;

/// From the end of a bidirectional frame to its answer, ns.
const ANSWER_DELAY_NS: u64 = 30_000;

/// What a datagram puts on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Frame<'a> {
    /// High for a while.
    Pulse { width_ns: u64 },
    /// 16 bits, from the highest on.
    DShot {
        bits_per_s: u64,
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
            10..=13 | 20..=23 => {
                let bits = payload.try_into().map_err(|_| wrong_length())?;
                Self::DShot {
                    bits_per_s: 150_000 << (protocol % 10),
                    bidirectional: *protocol >= 20,
                    bits: u16::from_le_bytes(bits),
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
            _ => return Err(Rejected::Protocol(*protocol)),
        };
        match frame.duration_ns() {
            0 if matches!(frame, Self::Pulse { .. }) => Err(Rejected::NoPulse),
            duration_ns if duration_ns > MAX_DURATION_NS => Err(Rejected::TooLong(duration_ns)),
            _ => Ok(frame),
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
                bits_per_s,
                bidirectional,
                bits,
            } => {
                for bit in 0..16 {
                    // A one is active for 6/8 of its time, a zero for 3/8.
                    let is_one = bits & (0x8000 >> bit) != 0;
                    let active = if is_one { 6 } else { 3 };
                    set(eighths_ns(8 * bit, bits_per_s), !bidirectional);
                    set(eighths_ns(8 * bit + active, bits_per_s), bidirectional);
                }
            }
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
            Self::DShot { bits_per_s, .. } => eighths_ns(16 * 8, bits_per_s),
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
            Self::DShot { bits_per_s, .. } => eighths_ns(DSHOT_REST_BITS * 8, bits_per_s),
            Self::Raw { .. } => 0,
        }
    }

    /// The rest that it needs after it, ns: after a bidirectional frame the time of its answer,
    /// which is 21 bits at 5/4 of the rate.
    pub(super) fn rest_after_ns(&self) -> u64 {
        match *self {
            Self::DShot {
                bits_per_s,
                bidirectional: true,
                ..
            } => ANSWER_DELAY_NS + eighths_ns(21 * 8, bits_per_s * 5 / 4) + self.rest_before_ns(),
            _ => self.rest_before_ns(),
        }
    }
}

/// Eighths of a bit in ns, rounded to the nearest.
fn eighths_ns(eighths: u64, bits_per_s: u64) -> u64 {
    let eighths_per_s = 8 * bits_per_s;
    (eighths * 1_000_000_000 + eighths_per_s / 2) / eighths_per_s
}
