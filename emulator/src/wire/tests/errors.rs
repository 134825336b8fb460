//! A faulty wire.

use super::*;

fn wrong(errors: WireErrors) -> Wire {
    let mut wire = Wire::detached();
    wire.sow(7);
    wire.disturb(errors);
    wire
}

/// Returns the bits of a frame by its pulse widths: a one is active for 5/8 of a bit or more.
fn bits(edges: &[(u64, bool)]) -> u16 {
    let pulses = edges.chunks(2);
    pulses.fold(0, |bits, pulse| {
        bits << 1 | u16::from(pulse[1].0 - pulse[0].0 > 937)
    })
}

#[test]
fn nothing_comes_through_a_lost_wire() {
    let mut wire = wrong(WireErrors {
        lost: true,
        ..WireErrors::default()
    });
    wire.play(1000, &dshot(12, 0xFFFF)).unwrap();
    assert_eq!(edges(&mut wire), []);
    wire.disturb(WireErrors::default());
    wire.play(u64::MAX / 2, &dshot(12, 0x1234)).unwrap();
    let edges: Vec<_> = std::iter::from_fn(|| wire.next_edge(u64::MAX)).collect();
    assert_eq!(bits(&edges), 0x1234);
}

#[test]
fn bits_are_wrong_at_their_rate() {
    let mut flipped = 0;
    for rate in [0.02, 1.0] {
        let mut wire = wrong(WireErrors {
            bit_error_rate: rate,
            ..WireErrors::default()
        });
        let frames = 5_000;
        flipped = 0;
        for frame in 0..frames {
            let at_ns = frame * 100_000;
            wire.play(at_ns, &dshot(12, 0xA5C3)).unwrap();
            let edges: Vec<_> = std::iter::from_fn(|| wire.next_edge(at_ns + 90_000)).collect();
            assert_eq!(edges.len(), 32);
            flipped += (bits(&edges) ^ 0xA5C3).count_ones();
        }
        let wanted = rate * 16.0 * frames as f64;
        // Four standard deviations of the binomial.
        let within = 4.0 * (wanted * (1.0 - rate)).sqrt();
        assert!((f64::from(flipped) - wanted).abs() <= within, "{flipped}");
    }
    assert_eq!(flipped, 80_000);
}

/// An edge displaced beyond what is sent next still comes before it.
#[test]
fn edges_do_not_go_back_when_the_jitter_ends() {
    for seed in 0..200 {
        let mut wire = Wire::detached();
        wire.sow(seed);
        wire.disturb(WireErrors {
            jitter_ns: 1e6,
            ..WireErrors::default()
        });
        wire.play(1_000_000, &dshot(12, 0x0F0F)).unwrap();
        wire.disturb(WireErrors::default());
        wire.play(1_000_000, &dshot(12, 0x0F0F)).unwrap();
        let edges: Vec<_> = std::iter::from_fn(|| wire.next_edge(u64::MAX)).collect();
        assert!(edges.is_sorted_by(|a, b| a.0 < b.0 && a.1 != b.1), "{seed}");
        assert_eq!(edges.len(), 64, "{seed}");
    }
}

/// Edges are displaced by the requested jitter, and stay in order however large it is.
#[test]
fn jitter_displaces_edges_and_keeps_their_order() {
    let stray = |jitter_ns: f64| {
        let mut wire = wrong(WireErrors {
            jitter_ns,
            ..WireErrors::default()
        });
        let sound = alone(&dshot(12, 0x0F0F));
        let mut strays = Vec::new();
        for frame in 1..500 {
            let at_ns = frame * 1_000_000;
            wire.play(at_ns, &dshot(12, 0x0F0F)).unwrap();
            let found: Vec<_> = std::iter::from_fn(|| wire.next_edge(at_ns + 500_000)).collect();
            assert!(found.is_sorted_by(|a, b| a.0 < b.0 && a.1 != b.1));
            for ((found_ns, _), (sound_ns, _)) in found.iter().zip(&sound) {
                strays.push(*found_ns as f64 - (at_ns - 1000 + sound_ns) as f64);
            }
        }
        let squares: f64 = strays.iter().map(|stray| stray * stray).sum();
        (squares / strays.len() as f64).sqrt()
    };
    let rms_ns = stray(40.0);
    assert!((rms_ns / 40.0 - 1.0).abs() < 0.05, "{rms_ns}");
    assert!(stray(2_000.0) > 500.0);
}
