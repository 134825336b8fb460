//! Which ESC of a rack reports which others by MAVLink.

use siskin_control::mavlink::Four;

use crate::device::Device;

/// An ESC's part in the messages for four.
#[derive(Clone, Copy, Debug)]
pub(super) enum Part {
    /// It reports itself.
    Alone,
    /// Another reports it.
    Follows,
    /// It reports those in these slots, and the number of ESCs in the vehicle.
    Leads([Option<usize>; 4], u8),
}

/// Returns the parts of all: of those numbered by their component ids, the lowest of each group of four leads.
pub(super) fn parts(escs: &[Device]) -> Vec<Part> {
    if escs.len() < 2 {
        return vec![Part::Alone; escs.len()];
    }
    let numbers: Vec<_> = escs.iter().map(|esc| esc.esc().number()).collect();
    let last = numbers.iter().flatten().max();
    let count = last.map_or(0, |last| last + 1);
    let part = |number: &Option<u8>| {
        let Some(own) = *number else {
            return Part::Alone;
        };
        let four = own - own % 4;
        let in_slot = |slot| numbers.iter().position(|n| *n == Some(four + slot));
        let slots = [0, 1, 2, 3].map(in_slot);
        let first = slots.into_iter().flatten().next();
        match first {
            Some(first) if numbers[first] == Some(own) => Part::Leads(slots, count),
            _ => Part::Follows,
        }
    };
    numbers.iter().map(part).collect()
}

/// Returns what a leading ESC reports, with the present state of its ESCs.
pub(super) fn four(escs: &[Device], slots: [Option<usize>; 4], count: u8) -> Four {
    Four {
        escs: slots.map(|esc| esc.map(|esc| *escs[esc].esc().telemetry())),
        count,
    }
}
