//! The detection matrix: every signal is detected under every condition, and nothing else is.

use siskin_throttle::dshot::Frame;
use siskin_throttle::line::Line;
use siskin_throttle::signal::{Pulse, Signal};

use crate::sender::{Errors, TICK_HZ, Wire, least_period_ns};

const PS_PER_MS: u64 = 1_000_000_000;

/// Runs per cell, each with another random sequence and another start within the first frame.
const RUNS: u64 = 20;

/// How long each run lasts, and by when the signal must be known.
const RUN_MS: u64 = 200;
const KNOWN_MS: f64 = 100.0;

/// A column of the matrix.
struct Condition {
    name: &'static str,
    errors: Errors,
    /// Frames per second.
    pace: Pace,
}

#[derive(Clone, Copy)]
enum Pace {
    Slowest,
    Usual,
    Fastest,
}

const NO_ERRORS: Errors = Errors {
    fast_permille: 0,
    jitter_ns: 0,
    glitch_ns: 0,
    flipped_permille: 0,
};

const fn usual(name: &'static str, errors: Errors) -> Condition {
    Condition {
        name,
        errors,
        pace: Pace::Usual,
    }
}

const CONDITIONS: [Condition; 9] = [
    usual("clean", NO_ERRORS),
    usual(
        "±60 ns",
        Errors {
            jitter_ns: 60,
            ..NO_ERRORS
        },
    ),
    usual(
        "+5 %",
        Errors {
            fast_permille: 50,
            ..NO_ERRORS
        },
    ),
    usual(
        "-5 %",
        Errors {
            fast_permille: -50,
            ..NO_ERRORS
        },
    ),
    usual(
        "1 % bits",
        Errors {
            flipped_permille: 10,
            ..NO_ERRORS
        },
    ),
    usual(
        "glitches",
        Errors {
            glitch_ns: 40,
            ..NO_ERRORS
        },
    ),
    usual(
        "+5, ±60",
        Errors {
            fast_permille: 50,
            jitter_ns: 60,
            ..NO_ERRORS
        },
    ),
    Condition {
        name: "slowest",
        errors: NO_ERRORS,
        pace: Pace::Slowest,
    },
    Condition {
        name: "fastest",
        errors: NO_ERRORS,
        pace: Pace::Fastest,
    },
];

impl Pace {
    /// Returns the frame interval, ns.
    fn period_ns(self, signal: Signal) -> u64 {
        let servo = signal == Signal::Pulse(Pulse::Servo);
        let ns = match self {
            Self::Slowest if servo => 20_000_000,
            Self::Slowest => 2_500_000,
            Self::Usual if servo => 5_000_000,
            Self::Usual => 1_000_000,
            // 8 kHz, or as fast as the signal allows.
            Self::Fastest if matches!(signal, Signal::Dshot { .. }) => 125_000,
            Self::Fastest => 0,
        };
        ns.max(least_period_ns(signal))
    }
}

/// Sends a frame, or a pulse near minimum throttle; the first one is joined midway.
fn send(wire: &mut Wire<Line>, signal: Signal, first: bool) {
    match signal {
        Signal::Dshot {
            rate,
            bidirectional,
        } => {
            let frame = Frame {
                value: wire.chance.below(2048) as u16,
                telemetry: wire.chance.once_in(8),
            };
            let skipped = if first { wire.chance.below(32) } else { 0 };
            wire.frame_from(skipped as usize, rate, bidirectional, frame.to_bits());
        }
        Signal::Pulse(kind) => {
            let end_points = kind.end_points_ns();
            let moved_ns = u64::from(end_points.most - end_points.least) / 10;
            let width_ns = u64::from(end_points.least) + wire.chance.below(moved_ns);
            if first {
                // The line was high when listening began.
                wire.rest_at(false);
            } else {
                wire.pulse(width_ns);
            }
        }
    }
}

/// Plays one run, and returns how long it took until the signal was known, ms.
fn known_after_ms(signal: Signal, condition: &Condition, seed: u64) -> Option<f64> {
    let mut wire = Wire::to_line(TICK_HZ, seed);
    wire.errors = condition.errors;
    let period_ps = condition.pace.period_ns(signal) * 1000;
    wire.now_ps = PS_PER_MS;
    // The line has been at rest, or listening begins in the middle of a frame or pulse.
    let mut first = wire.chance.once_in(2);
    if !first {
        wire.rest_at(signal.rests_high());
    }
    wire.now_ps += PS_PER_MS;
    let start_ps = wire.now_ps;
    if !first {
        wire.now_ps += wire.chance.below(period_ps);
    }
    let mut known_ms = None;
    while wire.now_ps < start_ps + RUN_MS * PS_PER_MS {
        let begun_ps = wire.now_ps;
        send(&mut wire, signal, first);
        first = false;
        wire.wait_until(begun_ps + period_ps);
        match wire.listener.signal() {
            Some(found) => {
                assert_eq!(found, signal, "{}, seed {seed}", condition.name);
                known_ms.get_or_insert_with(|| {
                    let (ticks, _) = *wire.events.last().expect("it was known by an event");
                    let known_s = ticks as f64 / f64::from(TICK_HZ);
                    known_s * 1e3 - start_ps as f64 / PS_PER_MS as f64
                });
            }
            None => assert_eq!(known_ms, None, "{} is forgotten", signal.name()),
        }
        wire.events.clear();
    }
    known_ms
}

#[test]
fn every_signal_is_detected_and_no_other() {
    let head = CONDITIONS.map(|condition| format!("{:>9}", condition.name));
    let mut table = format!(
        "ms until the signal is known, the longest of {RUNS} runs\n{:25}{}\n",
        "",
        head.concat()
    );
    let mut late = Vec::new();
    for signal in Signal::all() {
        table += &format!("{:25}", signal.name());
        for (column, condition) in CONDITIONS.iter().enumerate() {
            let is_pulse = matches!(signal, Signal::Pulse(_));
            if is_pulse && condition.errors.flipped_permille > 0 {
                // Pulses have no bits.
                table += &format!("{:>9}", "-");
                continue;
            }
            let times = (0..RUNS).map(|run| {
                let seed = run << 16 | u64::from(signal.number()) << 8 | column as u64;
                known_after_ms(signal, condition, seed).unwrap_or(f64::INFINITY)
            });
            let longest_ms = times.fold(0.0, f64::max);
            table += &format!("{longest_ms:9.1}");
            if longest_ms >= KNOWN_MS {
                late.push(format!("{}, {}", signal.name(), condition.name));
            }
        }
        table += "\n";
    }
    println!("{table}");
    assert!(late.is_empty(), "not known in time: {late:?}");
}
