//! Detects the signal on a channel.

use std::io::BufRead;

use siskin_throttle::line::Event;
use siskin_throttle::signal::Signal;

use super::capture::{Capture, Reason};
use super::sampling::Sampling;
use super::wire::{Item, Wire};
use super::{REST_NS, next_edge};

/// A sample rate at which every signal can be recognised.
const ENOUGH_HZ: f64 = 24e6;

/// How often a signal must occur in a capture that ends before the ESC is sure of it.
const HITS: u32 = 4;

/// Returns a channel's signal: what the ESC detects, or, if the capture is too short for that, what most of
/// it is.
///
/// # Errors
/// There is none.
pub(super) fn detect(mut capture: Capture<impl BufRead>, channel: usize) -> Result<Signal, Reason> {
    let mut wire = Wire::new(None);
    let mut sampling = Sampling::new(capture.sample_hz());
    let mut tally = Tally::default();
    let mut edges = 0;
    while let Some(edge) = next_edge(&mut capture, channel)? {
        edges += 1;
        sampling.edge(edge.at_ns);
        wire.edge(edge, &mut |item| tally.take(item));
        if let Some(signal) = wire.signal() {
            return Ok(signal);
        }
    }
    wire.rest(capture.now_ns() + REST_NS, &mut |item| tally.take(item));
    wire.signal().or_else(|| tally.winner()).ok_or_else(|| {
        let name = &capture.channels()[channel];
        if edges == 0 {
            format!("channel {name} has no edge; choose another with --channel")
        } else {
            format!(
                "no throttle signal is in the {edges} edges of channel {name}; capture more of it \
                 or name the signal by --protocol{}",
                faster(sampling.hz())
            )
        }
    })
}

/// Returns advice to sample faster, if that may help.
fn faster(sample_hz: Option<f64>) -> String {
    match sample_hz {
        Some(hz) if hz < ENOUGH_HZ => format!(
            "; or sample at {} MHz or more instead of {} MHz",
            ENOUGH_HZ / 1e6,
            hz / 1e6
        ),
        _ => String::new(),
    }
}

/// How often each signal has been seen.
#[derive(Debug, Default)]
struct Tally {
    seen: Vec<(Signal, u32)>,
    bad: u32,
}

impl Tally {
    fn take(&mut self, item: Item) {
        let Item::Event(found) = item else { return };
        match (found.event, found.event.signal()) {
            (_, Some(signal)) => match self.seen.iter_mut().find(|(seen, _)| *seen == signal) {
                Some((_, times)) => *times += 1,
                None => self.seen.push((signal, 1)),
            },
            (Event::Bad, _) => self.bad += 1,
            _ => {}
        }
    }

    /// Returns the signal that makes up most of what has been seen.
    fn winner(&self) -> Option<Signal> {
        let all = self.bad + self.seen.iter().map(|(_, times)| times).sum::<u32>();
        let most = self.seen.iter().max_by_key(|(_, times)| *times);
        let (signal, times) = *most?;
        (times >= HITS && times > all / 2).then_some(signal)
    }
}
