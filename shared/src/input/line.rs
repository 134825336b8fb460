//! One throttle wire: timed edges in, frames and pulses out.

use super::capture;
use super::detect::Detector;
use super::dshot::Rate;
pub use super::event::Event;
use super::filter::{Edge, Filter, since};
use super::pulse;
use super::signal::{Pulse, Signal};
use crate::math::quotient;

/// A line without an edge for so long is at rest, whatever was on it. At 50 Hz pulses leave 19 ms.
const SILENCE_MS: u32 = 100;

/// The wire's decoder.
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
    /// The line has been silent for long.
    silent: bool,
}

impl Line {
    /// A quiet line, captured by a timer of `tick_hz`.
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

    /// Takes one signal only, and counts others as bad; `None` detects it again from now on.
    pub fn force(&mut self, signal: Option<Signal>) {
        self.forced = signal.is_some();
        self.begin(signal);
    }

    /// The signal that was forced or has been detected. Before it is known, events may come from
    /// any signal, and must not turn a motor.
    pub fn signal(&self) -> Option<Signal> {
        self.signal
    }

    /// The signal is lost: a detected one is forgotten, a forced one stays.
    pub fn lost(&mut self) {
        if self.signal.is_some() && !self.forced {
            self.begin(None);
        }
    }

    /// Takes one edge: when it came, in ticks that wrap, and the level from then on.
    ///
    /// An edge is believed when its level has lasted for the filter's time, or when a frame ends with
    /// it: a checksum says more. So what this returns may come from the edge before.
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

    /// Takes all edges of a DShot frame at once, the first and the second of each of its 16 bits and whether
    /// the line was high before them, as [`Line::edge`] would one by one; nothing, and none of them is taken,
    /// if they are no frame, or one of another signal than that which is known.
    #[inline(always)] // in each frame, whose reply is due
    pub fn whole(&mut self, rests_high: bool, bit: impl Fn(usize) -> (u32, u32)) -> Option<Event> {
        let pulses = matches!(self.signal, Some(Signal::Pulse(_)));
        if pulses || !self.filter.rests_at(rests_high) {
            return None;
        }
        let (_, end) = bit(15);
        // The line rests high if it is bidirectional.
        let event = self.frames.whole(rests_high, bit)?;
        self.edge_at = end;
        self.silent = false;
        self.filter.settled(rests_high);
        if self.signal.is_none() {
            // No pulse goes over it.
            self.pulses.spoil();
            let _ = self.detector.pulse(end, Event::Bad);
            let event = self.detector.frame(end, event);
            self.know();
            return event;
        }
        Some(event)
    }

    /// Believes the last edge if the filter's time has passed since. To be called once a control
    /// period or more often, so that the end of a frame does not wait for the next one's edges.
    pub fn settle(&mut self, now_ticks: u32) -> Option<Event> {
        if self.silent {
            return None;
        }
        if let Some(edge) = self.filter.settle(now_ticks) {
            return self.decode(edge);
        }
        if since(now_ticks, self.edge_at) >= self.tick_hz / 1000 * SILENCE_MS {
            // Well before the ticks wrap, which would make a long level look like a short one.
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

    /// Takes an edge if it is within a frame; false otherwise.
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

    /// Weighs an edge, and the DShot decoder's event at it, while the signal is not known.
    fn detect(&mut self, edge: Edge, frame: Option<Event>) -> Option<Event> {
        let Edge { at_ticks, level } = edge;
        let pulse = self.pulses.edge(at_ticks, level);
        let pulse = pulse.and_then(|event| self.detector.pulse(at_ticks, event));
        let frame = frame.and_then(|event| self.detector.frame(at_ticks, event));
        self.know();
        frame.or(pulse)
    }

    /// Takes the detected signal and no other, once there is one.
    fn know(&mut self) {
        let signal = self.detector.signal();
        if signal.is_some() {
            self.take_only(signal);
        }
    }

    /// Begins to listen to one signal, or to find out which there is.
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

/// Time for which a level must last to be believed, ticks.
fn filter_ticks(tick_hz: u32, signal: Option<Signal>) -> u32 {
    let time_ns = match signal {
        // A sixteenth of a bit. The shortest level of DShot1200 with its errors is 66 ns.
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
