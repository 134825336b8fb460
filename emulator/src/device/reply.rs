//! The ESC's replies as levels on the throttle wire.

use std::collections::VecDeque;
use std::ops::Range;

use siskin_throttle::answer::{Reply, gcr};

use crate::machine::Onlooker;

/// The replies that the ESC puts on the wire.
#[derive(Debug, Default)]
pub(super) struct Driven {
    /// Edges still to come.
    edges: VecDeque<(u64, bool)>,
    /// When the pin is an output for the latest reply.
    span_ns: Range<u64>,
}

impl Driven {
    /// Puts a reply on the wire from `at_ns` on. The line idles high before and after. Returns
    /// false while another is pending or being sent, for a sender that does not leave it enough
    /// time.
    pub(super) fn drive(&mut self, now_ns: u64, reply: &Reply, at_ns: u64) -> bool {
        if now_ns < self.span_ns.end {
            return false;
        }
        let end_of = |bits: u32| at_ns + u64::from(bits) * 1_000_000_000 / u64::from(reply.bit_hz);
        let mut level = true;
        for bit in 0..gcr::BITS {
            let next = reply.bits >> (gcr::BITS - 1 - bit) & 1 != 0;
            if next != level {
                self.edges.push_back((end_of(bit), next));
                level = next;
            }
        }
        let end_ns = end_of(gcr::BITS);
        if !level {
            self.edges.push_back((end_ns, true));
        }
        self.span_ns = at_ns..end_ns;
        true
    }

    /// Returns true if the pin is an output at this time, so that nothing is captured.
    pub(super) fn is_output(&self, time_ns: u64) -> bool {
        self.span_ns.contains(&time_ns)
    }

    /// Reports the edges before this time.
    pub(super) fn show(&mut self, before_ns: u64, onlooker: &mut impl Onlooker) {
        let due = self.edges.partition_point(|edge| edge.0 < before_ns);
        for (time_ns, level) in self.edges.drain(..due) {
            onlooker.edge(time_ns, level);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reply_falls_first_and_ends_high() {
        let mut driven = Driven::default();
        let reply = Reply {
            bits: 0b0_10001_01110_10001_10110,
            bit_hz: 750_000,
            at_ticks: 0,
        };
        assert!(driven.drive(0, &reply, 1000));
        let edges: Vec<_> = driven.edges.iter().copied().collect();
        assert_eq!(edges[..3], [(1000, false), (2333, true), (3666, false)]);
        assert_eq!(*edges.last().unwrap(), (1000 + 28_000, true));
        assert!(edges.windows(2).all(|two| two[0].1 != two[1].1));
        assert!(driven.is_output(1000) && !driven.is_output(29_000));
        // One at a time, until it has ended.
        for now_ns in [0, 999, 1000, 28_999] {
            assert!(!driven.drive(now_ns, &reply, now_ns + 30_000), "{now_ns}");
        }
        assert_eq!(driven.edges, edges);
        assert!(driven.is_output(1000) && !driven.is_output(31_000));
        assert!(driven.drive(29_000, &reply, 59_000));
    }
}
