//! What both sides must agree on after each control period.

use siskin_control::drive::{Bridge, Config, Snapshot, State};
use siskin_units::{AdcCounts, Duty};
use xxhash_rust::xxh32::xxh32;

/// Words of a period's result: the bridge's, and the digest of the state.
pub const RESULT_WORDS: usize = 5;

/// Words per period on the chip: its result and its instruction count.
pub const PERIOD_WORDS: usize = RESULT_WORDS + 1;

/// Most bytes of the state's words: there are some 200 of four bytes.
const STATE_BYTES: usize = 4096;

/// Returns the result of one period.
pub fn result(config: &Config, state: &State, bridge: Bridge) -> [u32; RESULT_WORDS] {
    let [kind, a, b, c] = bridge_words(bridge);
    let mut bytes = [0; STATE_BYTES];
    let mut len = 0;
    state.trace(config, &mut |word: u32| {
        bytes[len..len + 4].copy_from_slice(&word.to_le_bytes());
        len += 4;
    });
    [kind, a, b, c, xxh32(&bytes[..len], 0)]
}

/// Words per period of the whole interrupt: what it has published, and its instruction count.
pub const INTERRUPT_WORDS: usize = 2;

/// Returns a digest of what the interrupt publishes.
pub fn snapshot(snapshot: &Snapshot) -> u32 {
    let [a, b, c] = snapshot.currents.map(AdcCounts::to_bits);
    let words = [
        snapshot.phase as i32,
        snapshot.faults.iter().count() as i32,
        snapshot.fault_count as i32,
        snapshot.angle.to_bits(),
        snapshot.speed.to_bits(),
        snapshot.i.d.to_bits(),
        snapshot.i.q.to_bits(),
        snapshot.u.d.to_bits(),
        snapshot.u.q.to_bits(),
        snapshot.bus.to_bits(),
        a,
        b,
        c,
    ];
    let mut bytes = [0; 52];
    for (to, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(words) {
        *to = word.to_le_bytes();
    }
    xxh32(&bytes, 0)
}

/// Returns what the bridge does: the kind in the low byte, for `Legs` the switching phases above it, and
/// the duties.
fn bridge_words(bridge: Bridge) -> [u32; 4] {
    match bridge {
        Bridge::Off => [0; 4],
        Bridge::Charge(duty) => [1, duty.to_bits(), 0, 0],
        Bridge::Brake => [2, 0, 0, 0],
        Bridge::Duty([a, b, c]) => [3, a.to_bits(), b.to_bits(), c.to_bits()],
        Bridge::Legs(legs) => {
            let switching = |phase: usize| u32::from(legs[phase].is_some()) << (8 + phase);
            let [a, b, c] = legs.map(|duty| duty.map_or(0, Duty::to_bits));
            [4 | switching(0) | switching(1) | switching(2), a, b, c]
        }
    }
}
