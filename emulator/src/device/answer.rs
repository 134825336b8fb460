//! What the ESC sends back: its reply's levels on the throttle wire, and datagrams to the sender.

use std::collections::VecDeque;
use std::ops::Range;

use siskin_control::answer::{Answer, Ask, Reply, gcr};
use siskin_control::input::signal::Signal;

use super::{CAPTURE_HZ, Device, Onlooker, ticks};

/// Byte 0 of a datagram with KISS telemetry, and of one with the ESC's information.
const KISS: u8 = 30;
const INFO: u8 = 31;

/// The replies that the ESC puts on the wire.
#[derive(Debug, Default)]
pub(super) struct Driven {
    /// Edges that are yet to come.
    edges: VecDeque<(u64, bool)>,
    /// When the pin is an output for the latest reply.
    span_ns: Range<u64>,
}

impl Driven {
    /// Puts a reply on the wire from `at_ns` on. The line rests high before and after it. There is
    /// none while another waits or is sent, for a sender that does not leave it its time.
    fn drive(&mut self, now_ns: u64, reply: &Reply, at_ns: u64) -> bool {
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

    /// Whether the pin is an output at this time, so that nothing is captured.
    pub(super) fn is_output(&self, time_ns: u64) -> bool {
        self.span_ns.contains(&time_ns)
    }

    /// Shows the edges before this time.
    pub(super) fn show(&mut self, before_ns: u64, onlooker: &mut impl Onlooker) {
        let due = self.edges.partition_point(|edge| edge.0 < before_ns);
        for (time_ns, level) in self.edges.drain(..due) {
            onlooker.edge(time_ns, level);
        }
    }
}

impl Device {
    /// Sends what was asked for at about `now_ns`.
    pub(super) fn answer(&mut self, now_ns: u64, ask: Ask, onlooker: &mut impl Onlooker) {
        let Answer { reply, kiss, info } = self.throttle.answer(ask, &self.rig.snapshot());
        let asked_ns = time_ns(ask.first_edge_ticks, now_ns);
        let mut send = |code: u8, payload: &[&[u8]]| {
            let datagram = [&[code], payload.concat().as_slice()].concat();
            onlooker.answer(&datagram);
            self.wire.send(asked_ns, &datagram);
        };
        let reply = reply.map(|reply| (reply, time_ns(reply.at_ticks, now_ns)));
        if let Some((reply, at_ns)) = reply
            && self.driven.drive(now_ns, &reply, at_ns)
        {
            let signal = Signal::Dshot {
                rate: ask.rate,
                bidirectional: true,
            };
            let end_ns = asked_ns + u64::from(ask.rate.frame_ns());
            let after_ns = at_ns.saturating_sub(end_ns) as u32;
            let payload = [reply.bits.to_le_bytes(), after_ns.to_le_bytes()];
            send(signal.number(), &[payload.as_flattened()]);
        }
        if let Some(kiss) = kiss {
            send(KISS, &[&kiss]);
        }
        if let Some(info) = info {
            send(INFO, &[&info]);
        }
    }
}

/// When the capturing timer shows a count: the time nearest to `near_ns`, to the next nanosecond.
fn time_ns(at_ticks: u32, near_ns: u64) -> u64 {
    let since = at_ticks.wrapping_sub(ticks(near_ns)) as i32;
    let near = u128::from(near_ns) * u128::from(CAPTURE_HZ) / 1_000_000_000;
    let count = near.saturating_add_signed(since.into());
    (count * 1_000_000_000).div_ceil(u128::from(CAPTURE_HZ)) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_is_the_time_at_which_it_begins() {
        // Ticks of 5.88 ns; the timer wraps each 25.26 s.
        for near_ns in [0, 1_000, 30_000_000_123, 90_000_000_000_000] {
            for ahead_ns in [0, 1, 5, 6, 56_667, 1_000_000] {
                let then_ns = near_ns + ahead_ns;
                for back in [(then_ns, near_ns), (near_ns, then_ns)] {
                    let told_ns = time_ns(ticks(back.0), back.1);
                    assert!(told_ns <= back.0 && back.0 - told_ns < 6, "{back:?}");
                    assert_eq!(ticks(told_ns), ticks(back.0));
                }
            }
        }
    }

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
