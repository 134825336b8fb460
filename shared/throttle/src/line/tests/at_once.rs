//! Whole frames taken at once.

use super::*;

/// Returns a frame's edges as bits, as a complete capture gives them.
fn bits_of(edges: &[(u64, bool)]) -> Option<[(u32, u32); 16]> {
    let bits: Vec<_> = edges
        .chunks_exact(2)
        .map(|two| (ticks(two[0].0), ticks(two[1].0)))
        .collect();
    (edges.len() == 32).then(|| bits.try_into().expect("sixteen"))
}

#[test]
fn behind_a_cut_frame_the_next_is_taken_at_once_when_its_rest_has_been_told() {
    for signal in all_dshot() {
        for edges in 1..32 {
            let mut wire = Wire::new();
            wire.edge(0, signal.rests_high());
            wire.wait(MS);
            for (at_ns, level) in wire.edges(signal).into_iter().take(edges) {
                wire.edge(at_ns, level);
            }
            // Nobody looks at the line until the next frame has come.
            wire.now_ns += 200_000;
            let bits = bits_of(&wire.edges(signal)).expect("a frame");
            for _ in 0..2 {
                wire.line.settle(bits[0].0);
            }
            let event = wire.line.whole(signal.rests_high(), |bit| bits[bit]);
            let found = event.and_then(|event| event.signal());
            // After an odd number of edges the line is at the other level: they are taken one by one.
            let wanted = (edges % 2 == 0).then_some(signal);
            assert_eq!(found, wanted, "{}, {edges}", signal.name());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// Frames with any content and gaps, stray edges and lost ones, of a signal that is known or still to be
    /// detected: taken whole or edge by edge, the result is the same.
    #[test]
    fn a_frame_at_once_is_what_its_edges_are(
        rate in 0..4_usize,
        bidirectional: bool,
        known: bool,
        steps in proptest::collection::vec(
            (0..2048_u16, 25_u64..2000, 0..8_u8, proptest::collection::vec(0..60_u64, 32)),
            1..60,
        ),
    ) {
        let rate = Rate::ALL[rate];
        let signal = Signal::Dshot { rate, bidirectional };
        let wire = || {
            if known {
                return Wire::of(signal);
            }
            let mut wire = Wire::new();
            wire.edge(0, signal.rests_high());
            wire.wait(5 * MS);
            wire
        };
        let mut by_edges = wire();
        let mut at_once = wire();
        let mut clean = true;
        for (value, gap_us, kind, strays) in steps {
            let now_ns = by_edges.now_ns + gap_us * 1000 + u64::from(rate.frame_ns()) / 4;
            for wire in [&mut by_edges, &mut at_once] {
                wire.events.clear();
                wire.wait(now_ns - wire.now_ns);
            }
            // Before detection, a frame's edges may look like a pulse for a moment.
            let counts = |event: &&Event| known || matches!(event, Event::Frame { .. });
            let (found, wanted) = (at_once.events.iter(), by_edges.events.iter());
            prop_assert!(found.filter(counts).eq(wanted.filter(counts)));
            let data = value << 1;
            let check = (data ^ data >> 4 ^ data >> 8) & 0xf;
            let word = (data << 4 | check) ^ check_mask(bidirectional);
            let mut sent: Vec<_> = edges(word, rate)
                .zip(strays)
                .map(|((after_ns, level), stray_ns)| {
                    (now_ns + u64::from(after_ns) + stray_ns, level != bidirectional)
                })
                .collect();
            match kind {
                // An edge is lost, two are, or a bit is changed.
                0 => drop(sent.remove(usize::from(value) % 32)),
                1 => drop(sent.drain(usize::from(value) % 31..).take(2).count()),
                2 => sent[9].0 += u64::from(rate.bit_ns()) / 3,
                _ => {}
            }
            let wanted: Vec<_> = sent
                .iter()
                .filter_map(|(at_ns, level)| by_edges.line.edge(ticks(*at_ns), *level))
                .collect();
            let whole = bits_of(&sent).and_then(|bits| at_once.line.whole(bidirectional, |bit| bits[bit]));
            // After one that was cut it may have to go edge by edge.
            prop_assert!(whole.is_some() || !clean || kind < 3);
            clean = whole.is_some();
            let found: Vec<_> = match whole {
                Some(event) => Vec::from([event]),
                None => sent
                    .iter()
                    .filter_map(|(at_ns, level)| at_once.line.edge(ticks(*at_ns), *level))
                    .collect(),
            };
            prop_assert!(found.iter().filter(counts).eq(wanted.iter().filter(counts)));
            prop_assert_eq!(at_once.line.signal(), by_edges.line.signal());
            for wire in [&mut by_edges, &mut at_once] {
                wire.now_ns = sent.last().map_or(now_ns, |(at_ns, _)| *at_ns);
                wire.settled_ns = wire.now_ns;
            }
        }
    }
}
