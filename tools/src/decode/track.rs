//! Matches what the decoder finds with the edges it was found in.

use std::collections::VecDeque;

use siskin_throttle::dshot::{Frame, check_mask};
use siskin_throttle::line::Event;
use siskin_throttle::signal::Signal;

use super::Edge;
use super::measure::{EDGES, Measured};
use super::reply::Reply;
use super::wire::{Found, Item};

/// A frame, a pulse or an error, with when it began.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sighting {
    pub(crate) at_ns: i64,
    pub(crate) what: What,
}

/// What has been seen.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum What {
    /// A frame with a correct checksum.
    Frame {
        frame: Frame,
        /// The 16 bits as sent.
        bits: u16,
        /// `None` if a glitch has split its pulses.
        measured: Option<Measured>,
        answer: Answer,
    },
    /// A pulse.
    Pulse { width_ns: u32 },
    /// Edges that the ESC counts as bad.
    Bad {
        /// How many.
        edges: usize,
        /// Its measurements, if the edges look like a frame.
        measured: Option<Measured>,
    },
}

/// What followed a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Answer {
    /// The wire carries no replies, or the capture ends before one.
    Unknown,
    /// It did not come.
    Missing,
    /// It came.
    Reply(Reply),
}

/// Assembles sightings.
pub(super) struct Tracker {
    signal: Signal,
    /// The latest two, since an error in one may be reported when the next has begun.
    bursts: VecDeque<Burst>,
}

/// Edges between two pauses.
#[derive(Debug)]
struct Burst {
    /// The first of them: as many as a frame has, plus one.
    edges: Vec<Edge>,
    count: usize,
    last_ns: i64,
    good: Option<Good>,
    bad: bool,
}

#[derive(Clone, Copy, Debug)]
enum Good {
    Frame(Frame, Answer),
    Pulse(u32),
}

impl Tracker {
    pub(super) fn new(signal: Signal) -> Self {
        Self {
            signal,
            bursts: VecDeque::new(),
        }
    }

    /// Takes the next item, and adds what it completes.
    pub(super) fn take(&mut self, item: Item, seen: &mut Vec<Sighting>) {
        match item {
            Item::Edge(edge) => self.edge(edge, seen),
            Item::Event(found) => self.event(found),
            Item::Reply(reply) => {
                let mut goods = self
                    .bursts
                    .iter_mut()
                    .filter_map(|burst| burst.good.as_mut());
                if let Some(Good::Frame(_, answer)) = goods.next_back() {
                    *answer = reply.map_or(Answer::Missing, Answer::Reply);
                }
            }
        }
    }

    /// Adds what is left when the capture ends.
    pub(super) fn finish(mut self, seen: &mut Vec<Sighting>) {
        while let Some(burst) = self.bursts.pop_front() {
            self.close(&burst, seen);
        }
    }

    fn edge(&mut self, edge: Edge, seen: &mut Vec<Sighting>) {
        match self.bursts.back_mut() {
            Some(burst) if !begins(self.signal, burst, edge) => burst.add(edge),
            _ => {
                self.bursts.push_back(Burst::new(edge));
                if self.bursts.len() > 2
                    && let Some(burst) = self.bursts.pop_front()
                {
                    self.close(&burst, seen);
                }
            }
        }
    }

    fn event(&mut self, found: Found) {
        let Some(latest) = self.bursts.len().checked_sub(1) else {
            return;
        };
        // An error may be reported at the next burst's first edges, a pulse at its first one.
        let open = |burst: &Burst| burst.good.is_none() && !burst.bad;
        let earlier = latest.saturating_sub(1);
        let place = match found.event {
            Event::Frame { .. } => self
                .bursts
                .iter()
                .rposition(|burst| found.first_edge_ns == Some(burst.edges[0].at_ns))
                .unwrap_or(latest),
            Event::Pulse { .. } if self.bursts[latest].count < 2 => earlier,
            Event::Pulse { .. } => latest,
            Event::Bad if open(&self.bursts[earlier]) => earlier,
            Event::Bad => latest,
        };
        let burst = &mut self.bursts[place];
        match found.event {
            Event::Frame { frame, .. } => burst.good = Some(Good::Frame(frame, Answer::Unknown)),
            Event::Pulse { width_ns, .. } => burst.good = Some(Good::Pulse(width_ns)),
            Event::Bad => burst.bad = true,
        }
    }

    fn close(&self, burst: &Burst, seen: &mut Vec<Sighting>) {
        let bidirectional = self.signal.rests_high();
        let measured = Measured::of(&burst.edges, !bidirectional);
        let good = burst.good.map(|good| match good {
            Good::Frame(frame, answer) => What::Frame {
                frame,
                bits: frame.to_bits() ^ check_mask(bidirectional),
                measured,
                answer,
            },
            Good::Pulse(width_ns) => What::Pulse { width_ns },
        });
        let bad = burst.bad.then_some(What::Bad {
            edges: burst.count,
            measured,
        });
        let at_ns = burst.edges[0].at_ns;
        for what in good.into_iter().chain(bad) {
            seen.push(Sighting { at_ns, what });
        }
    }
}

/// Returns whether an edge begins another burst.
fn begins(signal: Signal, burst: &Burst, edge: Edge) -> bool {
    match signal {
        // Within a frame that the decoder accepts, a level lasts at most 1.09 nominal bits; between two
        // frames, at least 1.5 bits of a sender that may be a twelfth fast: 1.37 nominal bits.
        Signal::Dshot { rate, .. } => edge.at_ns - burst.last_ns > i64::from(rate.bit_ns() * 5 / 4),
        Signal::Pulse(_) => edge.level,
    }
}

impl Burst {
    fn new(edge: Edge) -> Self {
        Self {
            edges: vec![edge],
            count: 1,
            last_ns: edge.at_ns,
            good: None,
            bad: false,
        }
    }

    fn add(&mut self, edge: Edge) {
        if self.edges.len() <= EDGES {
            self.edges.push(edge);
        }
        self.count += 1;
        self.last_ns = edge.at_ns;
    }
}
