//! Passes one wire's edges through the ESC's own decoder.

use std::num::NonZeroU32;

use siskin_throttle::line::{Event, Line};
use siskin_throttle::signal::Signal;

use super::Edge;
use super::reply::{Heard, Listener, Reply};

/// The decoder's clock: one tick is a nanosecond.
const TICK_HZ: u32 = 1_000_000_000;

/// After an edge the decoder is told the time this soon, ns, and then at doubling intervals: a frame is
/// known before its reply, and a pause takes few calls.
const FIRST_SETTLE_NS: i64 = 500;

/// The longest pause passed to the decoder, ns; longer ones are shortened to it, since ticks wrap after
/// 4.3 s. It exceeds every time in the decoder.
const LONGEST_REST_NS: i64 = 200_000_000;

/// What comes off the wire, in time order, except that an event follows its edges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Item {
    /// An edge that is not part of a reply.
    Edge(Edge),
    /// What the decoder found.
    Event(Found),
    /// What followed the previous bidirectional frame: a reply or none.
    Reply(Option<Reply>),
}

/// An event from the decoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Found {
    pub(super) event: Event,
    /// When a frame began, ns.
    pub(super) first_edge_ns: Option<i64>,
}

/// A wire being decoded.
pub(super) struct Wire {
    line: Line,
    /// The decoder's time, and the capture's.
    ticks: u32,
    now_ns: Option<i64>,
    listener: Option<Listener>,
}

impl Wire {
    /// Creates a wire that carries this signal; `None` detects it.
    pub(super) fn new(signal: Option<Signal>) -> Self {
        let mut line = Line::new(TICK_HZ);
        line.force(signal);
        Self {
            line,
            ticks: 0,
            now_ns: None,
            listener: None,
        }
    }

    /// Returns the signal, once it is known.
    pub(super) fn signal(&self) -> Option<Signal> {
        self.line.signal()
    }

    /// Takes the next edge.
    pub(super) fn edge(&mut self, edge: Edge, tell: &mut impl FnMut(Item)) {
        self.rest(edge.at_ns, tell);
        match &mut self.listener {
            Some(listener) => listener.edge(edge),
            None => self.pass(edge, tell),
        }
    }

    /// Advances to a time before which no edge came.
    pub(super) fn rest(&mut self, until_ns: i64, tell: &mut impl FnMut(Item)) {
        if self
            .listener
            .as_ref()
            .is_none_or(|listener| !listener.holds_edges())
        {
            self.settle(until_ns, tell);
        }
        let heard = self
            .listener
            .as_mut()
            .map(|listener| listener.verdict(until_ns));
        match heard {
            None | Some(Heard::More) => {}
            Some(Heard::Reply(reply)) => {
                self.listener = None;
                tell(Item::Reply(Some(reply)));
                self.settle(until_ns, tell);
            }
            Some(Heard::None(edges)) => {
                self.listener = None;
                tell(Item::Reply(None));
                // They may begin with a frame, whose reply is listened for in turn.
                for edge in edges {
                    self.edge(edge, tell);
                }
                self.rest(until_ns, tell);
            }
        }
    }

    fn pass(&mut self, edge: Edge, tell: &mut impl FnMut(Item)) {
        let event = self.line.edge(self.ticks, edge.level);
        self.tell_event(event, tell);
        tell(Item::Edge(edge));
    }

    /// Advances the decoder's time.
    fn settle(&mut self, until_ns: i64, tell: &mut impl FnMut(Item)) {
        let now_ns = *self.now_ns.get_or_insert(until_ns);
        let mut now_ns = now_ns.max(until_ns - LONGEST_REST_NS);
        let mut longest_ns = FIRST_SETTLE_NS;
        while now_ns < until_ns {
            let step_ns = longest_ns.min(until_ns - now_ns);
            longest_ns *= 2;
            now_ns += step_ns;
            self.now_ns = Some(now_ns);
            self.ticks = self.ticks.wrapping_add(step_ns as u32);
            let event = self.line.settle(self.ticks);
            self.tell_event(event, tell);
        }
    }

    fn tell_event(&mut self, event: Option<Event>, tell: &mut impl FnMut(Item)) {
        let Some(event) = event else { return };
        let mut first_edge_ns = None;
        if let Event::Frame {
            rate,
            bidirectional,
            first_edge_ticks,
            frame_ticks,
            ..
        } = event
        {
            let since_ns = self.ticks.wrapping_sub(first_edge_ticks);
            let begin_ns = self.now_ns.unwrap_or(0) - i64::from(since_ns);
            first_edge_ns = Some(begin_ns);
            if bidirectional {
                let frame_ns = frame_ticks.map_or(rate.frame_ns(), NonZeroU32::get);
                self.listener = Some(Listener::new(begin_ns, frame_ns));
            }
        }
        tell(Item::Event(Found {
            event,
            first_edge_ns,
        }));
    }
}
