//! Feeds any datagrams to the emulator's throttle wire: what is accepted comes out as edges in order, and
//! what is not has a reason.
#![no_main]

use libfuzzer_sys::fuzz_target;
use siskin_emulator::wire::Wire;
use siskin_fuzz::bytes::Bytes;

/// Longest time between two datagrams, ns.
const REST_NS: u64 = 2_000_000;

fuzz_target!(|input: &[u8]| {
    let mut input = Bytes(input);
    let mut wire = Wire::detached();
    let mut now_ns = 0_u64;
    let mut last: Option<(u64, bool)> = None;
    let mut sent = 0;
    let mut play = || {
        loop {
            let length = usize::from(input.u8()?).min(input.0.len());
            let (datagram, rest) = input.0.split_at(length);
            input.0 = rest;
            let before = wire.counts();
            let played = wire.play(now_ns, datagram);
            sent += 1;
            let counts = wire.counts();
            assert_eq!(counts.played + counts.rejected + counts.dropped, sent);
            assert_eq!(counts.played - before.played, u64::from(played.is_ok()));
            if let Err(rejected) = played {
                assert!(!rejected.to_string().is_empty());
            }
            let from_ns = now_ns;
            now_ns += u64::from(input.u8().unwrap_or(0)) * REST_NS / 255;
            while let Some((time_ns, level)) = wire.next_edge(now_ns) {
                assert!((from_ns..now_ns).contains(&time_ns), "{time_ns}");
                if let Some((last_ns, last_level)) = last {
                    assert!(time_ns > last_ns && level != last_level);
                }
                last = Some((time_ns, level));
            }
        }
    };
    let _: Option<()> = play();
});
