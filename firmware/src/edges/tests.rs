use core::cell::Cell;
use core::sync::atomic::{AtomicU32, Ordering};
use std::boxed::Box;
use std::vec::Vec;

use super::*;

/// Ticks until an edge is in memory.
const SETTLING: u32 = 10;

/// Ticks per bit.
const BIT: u32 = 280;

/// The timer and its DMA: edges come at their times, whoever looks.
struct Chip {
    memories: [&'static Memory; 2],
    /// Times written to each memory so far.
    counts: [Cell<usize>; 2],
    now: Cell<u64>,
    /// Edges to come: time, and the level after it.
    coming: Cell<Vec<(u64, bool)>>,
    bits: u32,
}

impl Chip {
    fn new(bits: u32) -> Self {
        let memory = || &*Box::leak(Box::new([const { AtomicU32::new(0) }; LEN]));
        Self {
            memories: [memory(), memory()],
            counts: [Cell::new(0), Cell::new(0)],
            now: Cell::new(0),
            coming: Cell::new(Vec::new()),
            bits,
        }
    }

    fn expect(&self, edges: impl IntoIterator<Item = (u64, bool)>) {
        let mut coming = self.coming.take();
        coming.extend(edges);
        self.coming.set(coming);
    }

    fn pass(&self, ticks: u64) {
        self.now.set(self.now.get() + ticks);
        let coming = self.coming.take();
        let (past, coming): (Vec<_>, Vec<_>) = coming
            .into_iter()
            .partition(|edge| edge.0 <= self.now.get());
        self.coming.set(coming);
        for (at, level) in past {
            let direction = usize::from(!level);
            let count = &self.counts[direction];
            let shown = at as u32 & u32::MAX >> (32 - self.bits);
            self.memories[direction][count.get() % LEN].store(shown, Ordering::Relaxed);
            count.set(count.get() + 1);
        }
    }

    /// Each look takes a while.
    fn shown(&self) -> u32 {
        self.pass(7);
        self.now.get() as u32 & u32::MAX >> (32 - self.bits)
    }

    fn left(&self, ring: usize) -> usize {
        self.pass(7);
        LEN - self.counts[ring].get() % LEN
    }

    fn fill<const BITS: u32>(&self, edges: &mut Edges<BITS>) -> bool {
        edges.fill(|| self.shown(), |ring| self.left(ring))
    }
}

/// A frame of alternating ones and zeros on a line that rests high.
fn frame(begin: u64) -> impl Iterator<Item = (u64, bool)> {
    (0..16).flat_map(move |bit| {
        let at = begin + u64::from(BIT) * bit;
        let low = u64::from(BIT) * (3 + 3 * (bit % 2)) / 8;
        [(at, false), (at + low, true)]
    })
}

fn taken<const BITS: u32>(edges: &mut Edges<BITS>) -> Vec<(u64, bool)> {
    let mut taken = Vec::new();
    edges.take(|at, level| taken.push((u64::from(at), level)));
    taken
}

#[test]
fn an_edge_while_it_is_looked_is_dated_right() {
    // Whenever it comes during the look, also as the 16-bit counter wraps.
    for begin in [20_000, 65_510] {
        for after in 0..40 {
            let chip = Chip::new(16);
            let mut edges = Edges::<16>::new(chip.memories, SETTLING);
            while chip.now.get() < begin {
                chip.pass(begin.min(20_000).min(begin - chip.now.get()));
                edges.now(chip.now.get() as u32 & 0xffff);
            }
            let at = begin + after;
            chip.expect([(at, false)]);
            assert!(chip.fill(&mut edges));
            if let Some(first) = edges.first() {
                assert_eq!(u64::from(first), at, "{after} ticks after {begin}");
            }
            chip.pass(100);
            assert!(chip.fill(&mut edges));
            assert_eq!(taken(&mut edges), [(at, false)], "{after}");
        }
    }
}

#[test]
fn edges_come_out_in_their_order_whenever_it_is_looked() {
    let chip = Chip::new(16);
    let mut edges = Edges::<16>::new(chip.memories, SETTLING);
    let sent: Vec<_> = (0..40)
        .flat_map(|number| frame(1000 + number * 9001))
        .collect();
    chip.expect(sent.iter().copied());
    let mut got = Vec::new();
    let mut step = 1;
    while chip.now.get() < 400_000 {
        // Up to 1500 ticks between two looks: five edges of each direction.
        step = step * 75 % 1501;
        chip.pass(step);
        assert!(chip.fill(&mut edges));
        got.extend(taken(&mut edges));
    }
    assert_eq!(got, sent);
}

#[test]
fn a_frame_is_read_though_the_next_one_has_begun() {
    let chip = Chip::new(32);
    let mut edges = Edges::<32>::new(chip.memories, SETTLING);
    let next = 10_000;
    chip.expect(frame(1000).chain(frame(next)));
    chip.pass(1000 + 15 * u64::from(BIT) - 1);
    assert!(chip.fill(&mut edges) && !edges.has_frame());
    chip.pass(next + 600 - chip.now.get());
    assert!(chip.fill(&mut edges));
    let (rests_high, read) = edges.frame().unwrap();
    assert!(rests_high);
    let sent: Vec<_> = frame(1000).map(|(at, _)| at as u32).collect();
    for bit in 0..16 {
        assert_eq!(read(bit), (sent[2 * bit], sent[2 * bit + 1]));
    }
    drop(read);
    assert!(edges.skip_frame());
    assert_eq!(edges.first(), Some(next as u32));
}

#[test]
fn what_came_before_a_reply_ended_is_its_own_and_the_rest_is_the_next_frame() {
    let chip = Chip::new(16);
    let mut edges = Edges::<16>::new(chip.memories, SETTLING);
    // Eleven edges of each direction, then a frame.
    chip.expect((0..11).flat_map(|n| [(500 + 400 * n, false), (700 + 400 * n, true)]));
    chip.expect(frame(5000));
    chip.pass(6000);
    assert!(chip.fill(&mut edges));
    edges.skip_before(4990);
    assert_eq!(edges.first(), Some(5000));
    chip.pass(15 * u64::from(BIT));
    assert!(chip.fill(&mut edges));
    assert_eq!(taken(&mut edges), frame(5000).collect::<Vec<_>>());
}

#[test]
fn who_is_behind_goes_on_with_the_last_frame_that_has_begun() {
    let chip = Chip::new(16);
    let mut edges = Edges::<16>::new(chip.memories, SETTLING);
    // Half of a frame is left, another is complete, and of the third there is the first edge or more.
    for of_third in [1, 2, 5] {
        let begin = chip.now.get() + 100;
        let third = begin + 18_000;
        chip.expect(frame(begin).skip(16));
        chip.expect(frame(begin + 9_000));
        chip.expect(frame(third).take(of_third));
        chip.pass(20_000);
        assert!(chip.fill(&mut edges));
        assert!(edges.skip_to_last_frame(1, 2 * BIT));
        assert!(!edges.skip_to_last_frame(1, 2 * BIT));
        let left: Vec<_> = frame(third).take(of_third).collect();
        assert_eq!(taken(&mut edges), left);
    }
    // The rest of a frame that was looked at too early, down to its last edge.
    for left_of_first in [1, 2, 3, 9] {
        let begin = chip.now.get() + 100;
        let second = begin + 9_000;
        chip.expect(frame(begin).skip(32 - left_of_first));
        chip.expect(frame(second).take(1));
        chip.pass(10_000);
        assert!(chip.fill(&mut edges));
        assert!(edges.skip_to_last_frame(1, 2 * BIT), "{left_of_first}");
        assert!(!edges.skip_to_last_frame(1, 2 * BIT));
        assert_eq!(taken(&mut edges), frame(second).take(1).collect::<Vec<_>>());
    }
    // One frame waiting alone, or before the start of another, is kept.
    let begin = chip.now.get() + 100;
    chip.expect(frame(begin));
    chip.pass(10_000);
    assert!(chip.fill(&mut edges));
    assert!(!edges.skip_to_last_frame(1, 2 * BIT));
    assert!(edges.has_frame());
}

/// This many edges at every 20th tick from `begin` on.
fn burst(begin: u64, count: u64) -> impl Iterator<Item = (u64, bool)> {
    (0..count).map(move |edge| (begin + 20 * edge, edge % 2 == 1))
}

#[test]
fn more_edges_than_the_memory_takes_are_noticed_between_two_looks() {
    for count in [2 * LEN as u64, 2 * LEN as u64 + 1, 4 * LEN as u64, 150] {
        let chip = Chip::new(32);
        let mut edges = Edges::<32>::new(chip.memories, SETTLING);
        chip.expect(burst(1000, count));
        chip.pass(10_000);
        assert!(!chip.fill(&mut edges), "{count}");
        assert_eq!(taken(&mut edges), []);
        // And what follows is complete again.
        chip.expect(frame(20_000));
        chip.pass(20_000);
        assert!(chip.fill(&mut edges));
        assert_eq!(taken(&mut edges), frame(20_000).collect::<Vec<_>>());
    }
}

#[test]
fn a_frame_that_is_overwritten_while_it_is_read_is_none() {
    for count in [34, 40, 64, 100] {
        let chip = Chip::new(32);
        let mut edges = Edges::<32>::new(chip.memories, SETTLING);
        chip.expect(frame(1000));
        chip.pass(8000);
        assert!(chip.fill(&mut edges) && edges.has_frame());
        chip.expect(burst(9000, count));
        chip.pass(4000);
        assert!(!edges.skip_frame(), "{count}");
        assert!(!chip.fill(&mut edges), "{count}");
        assert!(chip.fill(&mut edges));
    }
    // As many as fit besides it do no harm.
    let chip = Chip::new(32);
    let mut edges = Edges::<32>::new(chip.memories, SETTLING);
    chip.expect(frame(1000));
    chip.pass(8000);
    assert!(chip.fill(&mut edges));
    chip.expect(burst(9000, 30));
    chip.pass(4000);
    assert!(edges.skip_frame() && chip.fill(&mut edges));
}

#[test]
fn edges_that_are_overwritten_while_they_are_taken_are_not_given_out() {
    let chip = Chip::new(32);
    let mut edges = Edges::<32>::new(chip.memories, SETTLING);
    chip.expect(frame(1000));
    chip.pass(8000);
    assert!(chip.fill(&mut edges));
    chip.expect(burst(9000, 64));
    let mut given = Vec::new();
    edges.take(|at, _| {
        given.push(at);
        if given.len() == 5 {
            chip.pass(5000);
        }
    });
    assert_eq!(given.len(), 5);
    assert!(!chip.fill(&mut edges));
}

#[test]
fn what_is_forgotten_does_not_come_again_and_time_goes_on() {
    let chip = Chip::new(16);
    let mut edges = Edges::<16>::new(chip.memories, SETTLING);
    chip.expect(frame(1000));
    chip.pass(3000);
    assert!(chip.fill(&mut edges));
    edges.forget();
    assert_eq!((edges.first(), taken(&mut edges)), (None, Vec::new()));
    chip.pass(3000);
    assert!(chip.fill(&mut edges));
    let rest: Vec<_> = frame(1000).filter(|edge| edge.0 > 3014).collect();
    assert_eq!(taken(&mut edges), rest);
    // The look took four times 7 ticks, of which the first counts.
    assert_eq!(edges.settled(), 6028 + 7 - SETTLING);
    assert!(edges.is_before(6057) && !edges.is_before(6056));
}
