//! Feeds any edges in any rhythm to the throttle wire: the ESC neither panics nor turns its motor before
//! the wire is armed.
#![no_main]

use libfuzzer_sys::fuzz_target;
use siskin_fuzz::bytes::Bytes;
use siskin_fuzz::desk::Desk;
use siskin_throttle::signal::Signal;

/// Most steps played, repetitions included: enough to arm by repeating one frame.
const STEPS_PLAYED: usize = 8_000;

/// A step: an edge, or time.
#[derive(Clone, Copy)]
enum Step {
    Edge(u64, bool),
    Settle(u64),
}

fuzz_target!(|input: &[u8]| {
    let mut input = Bytes(input);
    let mut play = || {
        let signal = Signal::from_number(input.u8()?);
        // Near where the count wraps, or anywhere.
        let origin_ticks = u32::from(input.u16()?).wrapping_mul(65_521).wrapping_neg();
        let mut desk = Desk::new(signal, origin_ticks);
        let mut steps = Vec::new();
        let mut played = 0;
        while played < STEPS_PLAYED {
            let kind = input.u8()?;
            let time = u64::from(input.u8()?);
            let level = kind & 1 != 0;
            let step = match kind >> 1 & 7 {
                // About a bit at each rate, and what lies between.
                0 => Step::Edge(time * 10, level),
                1 => Step::Edge(time * 53, level),
                2 => Step::Edge(time * 1_000, level),
                3 => Step::Edge(time * 100_000, level),
                4 => Step::Settle(time * 100),
                5 => Step::Settle(time * 1_000_000),
                6 => Step::Settle(u64::from(input.u16()?) * 1_000_000),
                _ => {
                    // Repeats the last steps as often as given.
                    let from = steps.len() - steps.len().min(time as usize);
                    let again = steps[from..].to_vec();
                    for _ in 0..input.u8()? {
                        for &step in &again {
                            take(&mut desk, step);
                        }
                        played += again.len();
                        if played >= STEPS_PLAYED {
                            break;
                        }
                    }
                    continue;
                }
            };
            take(&mut desk, step);
            steps.push(step);
            played += 1;
        }
        Some(())
    };
    play();
});

fn take(desk: &mut Desk, step: Step) {
    let ask = match step {
        Step::Edge(after_ns, level) => desk.edge(after_ns, level),
        Step::Settle(after_ns) => desk.settle(after_ns),
    };
    if let Some(ask) = ask {
        let snapshot = desk.snapshot;
        desk.throttle.answer(ask, &snapshot);
    }
}
