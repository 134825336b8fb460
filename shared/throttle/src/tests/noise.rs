//! Random pulses on an armed wire whose sender has fallen silent.

use super::*;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;

/// How the widths of a noise are spread.
#[derive(Clone, Copy, Debug)]
enum Widths {
    /// All equally likely, up to so many µs.
    Even(f64),
    /// Each octave equally likely, up to so many µs.
    Octaves(f64),
}

impl Widths {
    /// Returns the width that is longer than this share of all, ns.
    fn at_ns(self, share: f64) -> u64 {
        const LEAST_US: f64 = 0.1;
        let width_us = match self {
            Self::Even(most_us) => LEAST_US + share * (most_us - LEAST_US),
            Self::Octaves(most_us) => LEAST_US * (most_us / LEAST_US).powf(share),
        };
        (width_us * 1e3) as u64
    }
}

impl Bench {
    /// Zero throttle until the wire is armed, then some more.
    fn armed_by(kind: Pulse) -> Self {
        let mut bench = Self::new(None);
        let zero_ns = u64::from(kind.end_points_ns().least);
        for _ in 0..100 {
            bench.pulse_of(zero_ns);
            bench.wait_ms(5);
        }
        assert!(bench.input.authority().armed(), "{kind:?}");
        bench
    }

    fn pulse_of(&mut self, width_ns: u64) {
        for (at_ns, level) in [(0, true), (width_ns, false)] {
            let ticks = self.ticks(at_ns);
            let heard = self.input.edge(self.now_us + at_ns / 1000, ticks, level);
            self.take(heard);
        }
    }
}

/// Returns how many of 500 armed wires turn the motor in 100 pulses of a noise. Its times are random too, or `even`.
fn turned(kind: Pulse, widths: Widths, rate_hz: f64, even: bool) -> usize {
    let mut runner = TestRunner::deterministic();
    let shares = prop::collection::vec((0.001..1.0_f64, 0.0..1.0_f64), 100);
    let armed = Bench::armed_by(kind);
    let mut turned = 0;
    for _ in 0..500 {
        let shares = shares.new_tree(&mut runner).expect("a noise").current();
        let mut bench = armed.clone();
        turned += usize::from(shares.into_iter().any(|(gap, width)| {
            let gap_ms = if even { 1.0 } else { -gap.ln() } * 1e3 / rate_hz;
            bench.wait_ms(1 + gap_ms as u64);
            let width_ns = widths.at_ns(width);
            bench.pulse_of(width_ns);
            bench.now_us += width_ns / 1_000;
            bench.turns()
        }));
        assert!(!bench.input.authority().armed() || bench.turns());
    }
    turned
}

#[test]
fn random_pulses_on_an_armed_wire_are_silence() {
    for kind in Pulse::ALL {
        let longest_us = f64::from(kind.end_points_ns().most) / 1e3;
        for widths in [
            Widths::Even(400.0),
            Widths::Octaves(400.0),
            Widths::Even(1.5 * longest_us),
            Widths::Octaves(1.5 * longest_us),
        ] {
            for rate_hz in [60.0, 200.0] {
                let case = (kind, widths, rate_hz);
                assert_eq!(turned(kind, widths, rate_hz, false), 0, "{case:?}");
                // At a sender's even rate, only the widths tell.
                let most = 2;
                assert!(turned(kind, widths, rate_hz, true) <= most, "{case:?}");
            }
        }
    }
}

proptest! {
    /// Three quarters of all steps are larger than what is alike.
    #[test]
    fn a_throttle_that_jumps_is_a_signal(
        steps in prop::collection::vec(-0.25..0.25_f64, 2_000),
    ) {
        for kind in Pulse::ALL {
            let ends = kind.end_points_ns();
            let range_ns = f64::from(ends.most - ends.least);
            let mut bench = Bench::armed_by(kind);
            for _ in 0..5 {
                bench.pulse_of(u64::from(ends.most));
                bench.wait_ms(5);
            }
            let mut share = 0.5;
            for step in &steps {
                share = f64::clamp(share + step, 0.1, 1.0);
                bench.pulse_of(u64::from(ends.least) + (share * range_ns) as u64);
                bench.wait_ms(5);
                prop_assert!(bench.turns(), "{kind:?}");
            }
        }
    }
}

#[test]
fn one_pulse_never_opens_the_throttle() {
    for kind in Pulse::ALL {
        let ends = kind.end_points_ns();
        for share in [8, 4, 2, 1] {
            let mut bench = Bench::armed_by(kind);
            let open_ns = u64::from(ends.least + (ends.most - ends.least) / share);
            for _ in 0..20 {
                bench.pulse_of(open_ns);
                assert!(!bench.turns(), "{kind:?} {open_ns}");
                for _ in 0..5 {
                    bench.wait_ms(5);
                    bench.pulse_of(u64::from(ends.least));
                    assert!(!bench.turns());
                }
                bench.wait_ms(5);
            }
            // Held, it opens.
            for _ in 0..5 {
                bench.pulse_of(open_ns);
                bench.wait_ms(5);
            }
            assert!(bench.turns(), "{kind:?} {open_ns}");
        }
    }
}

#[test]
fn a_sender_may_change_its_rate_at_zero_and_in_flight() {
    for forced in [None, Some(Signal::Pulse(Pulse::Servo))] {
        let mut bench = Bench::new(forced);
        let mut hold = |width_ns: u64, gap_ms: u64, ms: u64| {
            for _ in 0..ms / (gap_ms + 2) {
                bench.pulse_of(width_ns);
                bench.wait_ms(gap_ms);
            }
            (bench.input.authority().armed(), bench.turns())
        };
        assert_eq!(hold(1_000_000, 18, 1_000), (true, false));
        assert_eq!(hold(1_000_000, 2, 1_000), (true, false));
        assert_eq!(hold(1_000_000, 18, 1_000), (true, false));
        assert_eq!(hold(1_500_000, 18, 1_000), (true, true));
        assert_eq!(hold(1_500_000, 2, 1_000), (true, true));
        assert_eq!(hold(1_500_000, 18, 1_000), (true, true));
    }
}
