//! Decodes one throttle wire: timed edges in, frames and pulses out.

use siskin_units::math::quotient;

use super::capture;
use super::detect::Detector;
use super::dshot::Rate;
pub use super::event::Event;
use super::filter::{Edge, Filter, since};
use super::pulse;
use super::signal::{Pulse, Signal};

/// Without an edge for this long a line is at rest, whatever it carried. At 50 Hz pulses leave 19 ms.
const SILENCE_MS: u32 = 100;

/// The decoder of one wire.
#[derive(Clone, Debug)]
pub struct Line {
    tick_hz: u32,
    filter: Filter,
    frames: capture::Decoder,
    pulses: pulse::Decoder,
    detector: Detector,
    signal: Option<Signal>,
    forced: bool,
    edge_at: u32,
    /// No edge for [`SILENCE_MS`].
    silent: bool,
}

impl Line {
    /// Creates the decoder of a quiet line, captured by a timer of `tick_hz`.
    pub fn new(tick_hz: u32) -> Self {
        Self {
            tick_hz,
            filter: Filter::new(filter_ticks(tick_hz, None)),
            frames: capture::Decoder::new(tick_hz),
            pulses: pulse::Decoder::new(tick_hz),
            detector: Detector::new(tick_hz),
            signal: None,
            forced: false,
            edge_at: 0,
            silent: true,
        }
    }

    /// Accepts one signal only and counts others as bad; `None` restarts detection.
    pub fn force(&mut self, signal: Option<Signal>) {
        self.forced = signal.is_some();
        self.begin(signal);
    }

    /// Returns the forced or detected signal. Before it is known, events may come from any signal and must not
    /// turn a motor.
    pub fn signal(&self) -> Option<Signal> {
        self.signal
    }

    /// Handles a lost signal: forgets a detected one, keeps a forced one.
    pub fn lost(&mut self) {
        if self.signal.is_some() && !self.forced {
            self.begin(None);
        }
    }

    /// Takes one edge: its capture time in wrapping ticks, and the level from then on.
    ///
    /// An edge is accepted once its level has lasted for the filter time, or when it completes a frame, since a
    /// checksum is stronger evidence. The returned event may therefore come from the previous edge.
    pub fn edge(&mut self, at_ticks: u32, level: bool) -> Option<Event> {
        self.edge_at = at_ticks;
        self.silent = false;
        let filtered = self.filter.edge(at_ticks, level);
        let event = match filtered.believed {
            Some(edge) if !self.pass(edge) => self.decode(edge),
            _ => None,
        };
        if filtered.missed {
            self.frames.spoil(at_ticks);
            self.pulses.spoil();
        }
        if event.is_some() {
            return event;
        }
        if matches!(self.signal, Some(Signal::Pulse(_))) {
            return None;
        }
        let last = self.filter.pending()?;
        let frame = self.frames.end(last)?;
        self.filter.believe();
        match self.signal {
            Some(_) => Some(frame),
            None => self.detect(last, Some(frame)),
        }
    }

    /// Takes all edges of a DShot frame at once: the leading and trailing edge of each of its 16 bits, and
    /// whether the line was high before them. Equivalent to [`Line::edge`] on each; returns `None`, and takes
    /// none of them, if they are no frame or belong to a signal other than the known one.
    #[inline(always)] // in each frame, whose reply is due
    pub fn whole(&mut self, rests_high: bool, bit: impl Fn(usize) -> (u32, u32)) -> Option<Event> {
        let pulses = matches!(self.signal, Some(Signal::Pulse(_)));
        if pulses || !self.filter.rests_at(rests_high) {
            return None;
        }
        let (_, end) = bit(15);
        // A bidirectional line rests high.
        let event = self.frames.whole(rests_high, bit)?;
        self.edge_at = end;
        self.silent = false;
        self.filter.settled(rests_high);
        if self.signal.is_none() {
            // No pulse spans it.
            self.pulses.spoil();
            let _ = self.detector.pulse(end, Event::Bad);
            let event = self.detector.frame(end, event);
            self.know();
            return event;
        }
        Some(event)
    }

    /// Accepts the last edge if the filter time has passed. Call it at least once per control period, so that
    /// the end of a frame need not wait for the next one's edges.
    pub fn settle(&mut self, now_ticks: u32) -> Option<Event> {
        if self.silent {
            return None;
        }
        if let Some(edge) = self.filter.settle(now_ticks) {
            return self.decode(edge);
        }
        if since(now_ticks, self.edge_at) >= self.tick_hz / 1000 * SILENCE_MS {
            // Well before the ticks wrap, after which a long level would look short.
            self.silent = true;
            self.filter.rest();
            self.clear();
            return None;
        }
        match self.signal {
            Some(Signal::Dshot { .. }) => self.frames.settle(now_ticks),
            Some(Signal::Pulse(_)) => None,
            None => {
                let event = self.frames.settle(now_ticks)?;
                self.detector.frame(now_ticks, event)
            }
        }
    }

    /// Takes an edge inside a frame; returns false if it is not in one.
    fn pass(&mut self, edge: Edge) -> bool {
        matches!(self.signal, Some(Signal::Dshot { .. })) && self.frames.pass(edge.at_ticks)
    }

    fn decode(&mut self, edge: Edge) -> Option<Event> {
        let Edge { at_ticks, level } = edge;
        match self.signal {
            Some(Signal::Dshot { .. }) => self.frames.edge(at_ticks, level),
            Some(Signal::Pulse(_)) => self.pulses.edge(at_ticks, level),
            None => {
                let frame = self.frames.edge(at_ticks, level);
                self.detect(edge, frame)
            }
        }
    }

    /// Weighs an edge, and the DShot decoder's event at it, while the signal is unknown.
    fn detect(&mut self, edge: Edge, frame: Option<Event>) -> Option<Event> {
        let Edge { at_ticks, level } = edge;
        let pulse = self.pulses.edge(at_ticks, level);
        let pulse = pulse.and_then(|event| self.detector.pulse(at_ticks, event));
        let frame = frame.and_then(|event| self.detector.frame(at_ticks, event));
        self.know();
        frame.or(pulse)
    }

    /// Locks onto the detected signal, once there is one.
    fn know(&mut self) {
        let signal = self.detector.signal();
        if signal.is_some() {
            self.take_only(signal);
        }
    }

    /// Starts listening to one signal, or detecting it.
    fn begin(&mut self, signal: Option<Signal>) {
        self.take_only(signal);
        self.clear();
    }

    fn take_only(&mut self, signal: Option<Signal>) {
        self.signal = signal;
        self.filter.time_ticks = filter_ticks(self.tick_hz, signal);
        self.frames.take_only(match signal {
            Some(Signal::Dshot {
                rate,
                bidirectional,
            }) => Some((rate, bidirectional)),
            _ => None,
        });
        self.pulses.take_only(match signal {
            Some(Signal::Pulse(kind)) => Some(kind),
            _ => None,
        });
    }

    fn clear(&mut self) {
        self.frames.clear();
        self.pulses.clear();
        self.detector.clear();
    }
}

/// Returns how long a level must last to be accepted, ticks.
fn filter_ticks(tick_hz: u32, signal: Option<Signal>) -> u32 {
    let time_ns = match signal {
        // A sixteenth of a bit. The shortest level of DShot1200 with its tolerances is 66 ns.
        None => Rate::Dshot1200.bit_ns() / 16,
        Some(Signal::Dshot { rate, .. }) => rate.bit_ns() / 16,
        Some(Signal::Pulse(Pulse::Multishot)) => 200,
        Some(Signal::Pulse(Pulse::OneShot125 | Pulse::OneShot42)) => 500,
        Some(Signal::Pulse(Pulse::Servo)) => 2_000,
    };
    quotient(u64::from(tick_hz) * u64::from(time_ns), 1_000_000_000)
}

#[cfg(test)]
mod tests;
