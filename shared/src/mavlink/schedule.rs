//! The schedule of messages sent without a request.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    ESC_INFO_DATA, ESC_STATUS_DATA, ESC_TELEMETRY_1_TO_4_DATA, HEARTBEAT_DATA,
    NAMED_VALUE_FLOAT_DATA,
};
use siskin_params::{ParamId, Params};

use super::pace::Pace;
use super::place::Place;

const SECOND_US: u64 = 1_000_000;

/// A message sent periodically. The order is that of the stored intervals.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stream {
    Heartbeat,
    EscInfo,
    EscStatus,
    EscTelemetry,
    /// NAMED_VALUE_FLOAT of the throttle wire: the one meant by intervals and requests of this message.
    BadFrames,
    /// NAMED_VALUE_FLOAT of the control's signals, all of one instant.
    Signals,
}

impl Stream {
    const ALL: [Self; 6] = [
        Self::Heartbeat,
        Self::EscInfo,
        Self::EscStatus,
        Self::EscTelemetry,
        Self::BadFrames,
        Self::Signals,
    ];

    const fn message(self, place: Place) -> u32 {
        match self {
            Self::Heartbeat => HEARTBEAT_DATA::ID,
            Self::EscInfo => ESC_INFO_DATA::ID,
            Self::EscStatus => ESC_STATUS_DATA::ID,
            Self::EscTelemetry => place.telemetry().0,
            Self::BadFrames | Self::Signals => NAMED_VALUE_FLOAT_DATA::ID,
        }
    }

    /// Returns the most bytes that its frames take, including overhead.
    fn frames_len(self, params: &Params, overhead_len: usize) -> usize {
        let (frames, len) = match self {
            Self::Heartbeat => (1, HEARTBEAT_DATA::ENCODED_LEN),
            Self::EscInfo => (1, ESC_INFO_DATA::ENCODED_LEN),
            Self::EscStatus => (1, ESC_STATUS_DATA::ENCODED_LEN),
            Self::EscTelemetry => (1, ESC_TELEMETRY_1_TO_4_DATA::ENCODED_LEN),
            Self::BadFrames => (1, NAMED_VALUE_FLOAT_DATA::ENCODED_LEN),
            Self::Signals => (
                signals(params).count_ones(),
                NAMED_VALUE_FLOAT_DATA::ENCODED_LEN,
            ),
        };
        frames as usize * (overhead_len + len)
    }

    /// Returns the default interval; `None` if the stream is off.
    fn default_interval_us(self, params: &Params) -> Option<u64> {
        let rate = match self {
            Self::Heartbeat | Self::EscInfo | Self::BadFrames => return Some(SECOND_US),
            Self::Signals if signals(params) == 0 => return None,
            Self::Signals => ParamId::TelSigHz,
            Self::EscStatus | Self::EscTelemetry => ParamId::TelRateHz,
        };
        Some(u64::from((SECOND_US as f32 / params.get(rate)) as u32))
    }
}

/// Returns the streamed signals, a bit for each.
pub(super) fn signals(params: &Params) -> u32 {
    params.get(ParamId::TelSignals) as u32
}

/// The interval of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Interval {
    /// As set by the parameters.
    Default,
    /// Never.
    Off,
    /// Microseconds between two, above 0.
    Us(u32),
}

impl Interval {
    /// Returns its stored form.
    fn bits(self) -> u32 {
        match self {
            Self::Default => 0,
            Self::Off => u32::MAX,
            Self::Us(interval_us) => interval_us,
        }
    }

    fn from_bits(bits: u32) -> Option<Self> {
        match bits {
            0 => Some(Self::Default),
            u32::MAX => Some(Self::Off),
            // MESSAGE_INTERVAL is an i32.
            _ => i32::try_from(bits).is_ok().then_some(Self::Us(bits)),
        }
    }
}

/// Message intervals that override those from the parameters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Intervals([u32; Stream::ALL.len()]);

impl Intervals {
    /// The number of words that store them.
    pub(crate) const WORDS: usize = Stream::ALL.len();

    /// Returns one of the words; zero means as the parameters say.
    pub(crate) fn word(&self, word: usize) -> u32 {
        self.0[word]
    }

    /// Sets a word from storage. Returns true if it is valid.
    pub(crate) fn set_word(&mut self, word: usize, bits: u32) -> bool {
        let fits = Interval::from_bits(bits).is_some();
        if fits {
            self.0[word] = bits;
        }
        fits
    }
}

#[derive(Clone, Copy, Debug)]
struct Timer {
    interval: Interval,
    due_us: u64,
}

/// The timers of the streams, within a share of the link.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    timers: [Timer; Stream::ALL.len()],
    pace: Pace,
    place: Place,
    /// Another ESC sends the messages for four.
    led: bool,
    /// The stream checked first, so that on a link too slow for all each gets its turn.
    first: usize,
}

impl Schedule {
    pub(super) fn new(place: Place, bytes_per_s: u32) -> Self {
        Self {
            timers: [Timer {
                interval: Interval::Default,
                due_us: 0,
            }; Stream::ALL.len()],
            pace: Pace::new(bytes_per_s),
            place,
            led: false,
            first: 0,
        }
    }

    /// Returns the stream of this message; the first, if several have it.
    pub(super) fn find(&self, message: u32) -> Option<Stream> {
        Stream::ALL
            .into_iter()
            .find(|stream| stream.message(self.place) == message && self.sends(*stream))
    }

    /// Leaves the messages for four to another ESC.
    #[cfg(feature = "group")]
    pub(super) fn follow(&mut self) {
        self.led = true;
    }

    /// Returns true if it leaves them to another.
    #[cfg(feature = "group")]
    pub(super) fn follows(&self) -> bool {
        self.led
    }

    fn sends(&self, stream: Stream) -> bool {
        let for_four = matches!(
            stream,
            Stream::EscInfo | Stream::EscStatus | Stream::EscTelemetry
        );
        !(cfg!(feature = "group") && self.led && for_four)
    }

    /// Makes a stream due now, unless it is off.
    pub(super) fn hasten(&mut self, stream: Stream) {
        self.timers[stream as usize].due_us = 0;
    }

    /// Changes how often a stream is sent. Returns false for the heartbeat: without it the ESC is gone for every ground
    /// station.
    pub(super) fn set(&mut self, stream: Stream, interval: Interval) -> bool {
        if stream == Stream::Heartbeat && interval != Interval::Default {
            return false;
        }
        self.timers[stream as usize].interval = interval;
        true
    }

    /// Returns the intervals, to be stored.
    pub(super) fn intervals(&self) -> Intervals {
        Intervals(self.timers.map(|timer| timer.interval.bits()))
    }

    /// Restores the stored intervals.
    pub(super) fn keep(&mut self, intervals: &Intervals) {
        for (stream, bits) in Stream::ALL.into_iter().zip(intervals.0) {
            let interval = Interval::from_bits(bits).unwrap_or(Interval::Default);
            // The heartbeat's remains unchanged.
            self.set(stream, interval);
        }
    }

    /// Returns the microseconds between two; `None` if the stream is off.
    pub(super) fn interval_us(&self, stream: Stream, params: &Params) -> Option<u64> {
        if !self.sends(stream) {
            return None;
        }
        match self.timers[stream as usize].interval {
            Interval::Default => stream.default_interval_us(params),
            Interval::Off => None,
            Interval::Us(interval_us) => Some(u64::from(interval_us)),
        }
    }

    /// Returns the next stream that is due; each is due at most once per `now_us`. `overhead_len` is the length of a
    /// frame without payload.
    pub(super) fn next_due(
        &mut self,
        now_us: u64,
        params: &Params,
        overhead_len: usize,
    ) -> Option<Stream> {
        let mut blocked = false;
        for offset in 0..Stream::ALL.len() {
            let index = (self.first + offset) % Stream::ALL.len();
            let stream = Stream::ALL[index];
            let Some(interval_us) = self.interval_us(stream, params) else {
                continue;
            };
            let timer = &mut self.timers[index];
            let next_us = now_us.saturating_add(interval_us);
            // A faster rate applies at once, not after the slower one's interval.
            timer.due_us = timer.due_us.min(next_us);
            if timer.due_us > now_us {
                continue;
            }
            // A stream that finds too little of the share left blocks those after it: otherwise shorter messages would
            // take it all. Only the heartbeat passes.
            blocked = blocked
                || !self
                    .pace
                    .take(now_us, stream.frames_len(params, overhead_len));
            if blocked && stream != Stream::Heartbeat {
                continue;
            }
            timer.due_us = timer.due_us.saturating_add(interval_us);
            if timer.due_us <= now_us {
                timer.due_us = next_us;
            }
            if stream != Stream::Heartbeat {
                self.first = index + 1;
            }
            return Some(stream);
        }
        None
    }
}
