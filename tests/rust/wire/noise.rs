//! Four kinds of noise on the wire, 10⁸ edges in total: it never arms, and never gives an order.
//!
//! The arming time is the shortest that the parameter allows. Each kind is heard in both polarities, with
//! the signal to be detected and with each signal forced; afterwards real frames arm the same wire, which
//! shows that it could have been armed.

use siskin_throttle::authority::{DriveStatus, Timing};
use siskin_throttle::demand::Reading;
use siskin_throttle::dshot::{Frame, Rate};
use siskin_throttle::line::Event;
use siskin_throttle::signal::Signal;
use siskin_throttle::{Heard, Input, Settings};

use crate::sender::{Listener, TICK_HZ, Wire, least_period_ns};

/// Edges of each kind, split into runs: in half of them the signal is to be detected.
const EDGES: u64 = 25_000_000;
const SIGNALS: u64 = 12;
const RUN_EDGES: u64 = EDGES / (2 * 2 * SIGNALS);

/// The minimum of `INP_ARM_MS`.
const ARM_US: u64 = 10_000;

const PS_PER_NS: u64 = 1_000;
const PS_PER_US: u64 = 1_000_000;

/// How often the tasks run, µs.
const POLL_US: u64 = 1_000;

/// The wire's whole input, which must neither arm nor give an order while there is noise.
struct Ear {
    input: Input,
    noise: bool,
    edges: u64,
    polled_us: u64,
}

impl Ear {
    fn new(protocol: Option<Signal>) -> Self {
        let settings = Settings {
            protocol,
            timing: Timing {
                arm_us: ARM_US,
                loss_us: 100_000,
            },
            reading: Reading::default(),
        };
        Self {
            input: Input::new(TICK_HZ, settings),
            noise: true,
            edges: 0,
            polled_us: 0,
        }
    }

    /// Polls with the motor at rest, so that commands are obeyed.
    fn poll(&mut self, now_us: u64) {
        if now_us - self.polled_us >= POLL_US {
            self.polled_us = now_us;
            let drive = DriveStatus {
                stopped: true,
                faulted: false,
            };
            self.input.poll(now_us, drive);
        }
    }

    fn hear(&self, heard: Option<Heard>) -> Option<Event> {
        if self.noise {
            assert!(!self.armed(), "armed by noise");
            assert!(self.input.authority().command().rests(), "turned by noise");
        }
        let Heard { event, order } = heard?;
        // Before the first bad frame, the wire is only known to carry good ones.
        let clean = self.input.bad_frames() == 0;
        assert!(
            order.is_none() || !self.noise || clean,
            "{order:?} by noise"
        );
        Some(event)
    }

    fn armed(&self) -> bool {
        self.input.authority().armed()
    }
}

fn us(ticks: u64) -> u64 {
    ticks / u64::from(TICK_HZ / 1_000_000)
}

impl Listener for Ear {
    fn edge(&mut self, at_ticks: u64, level: bool) -> Option<Event> {
        self.edges += 1;
        let heard = self.input.edge(us(at_ticks), at_ticks as u32, level);
        self.hear(heard)
    }

    fn settle(&mut self, now_ticks: u64) -> Option<Event> {
        let heard = self.input.settle(us(now_ticks), now_ticks as u32);
        self.poll(us(now_ticks));
        self.hear(heard)
    }
}

/// A listener exposed to a kind of noise.
struct Run {
    wire: Wire<Ear>,
    /// Whether all levels are inverted.
    inverted: bool,
    /// Number of the run, for noise that has several forms.
    form: u64,
    frames: u64,
}

impl Run {
    /// Plays an edge, `after_ps` after the previous one.
    fn edge(&mut self, after_ps: u64, level: bool) {
        self.wire.now_ps += after_ps;
        self.wire.edge(self.wire.now_ps, level != self.inverted);
    }

    /// Sends a perfectly timed word, and pauses for 2 to 100 µs.
    fn word(&mut self, bits: u16, rate: Rate) {
        // Sent as given: the sender inverts the checksum of a bidirectional one.
        self.wire.frame(rate, self.inverted, bits);
        self.wire.now_ps += self.wire.chance.between(0, 98 * PS_PER_US);
    }

    /// Returns the forced rate, or one that stays for the run, or a different one each time.
    fn rate(&mut self, protocol: Option<Signal>) -> Rate {
        match protocol {
            Some(Signal::Dshot { rate, .. }) => rate,
            _ if self.form < 8 => Rate::ALL[self.form as usize % 4],
            _ => Rate::ALL[self.wire.chance.below(4) as usize],
        }
    }
}

/// What came of a kind of noise.
struct Outcome {
    /// Whatever was not a frame.
    bad: u64,
    /// Frames and pulses of a known signal.
    frames: u64,
}

/// Plays noise; each call of `burst` makes one burst.
fn play(seed: u64, mut burst: impl FnMut(&mut Run, Option<Signal>)) -> Outcome {
    let mut outcome = Outcome { bad: 0, frames: 0 };
    for (number, signal) in Signal::all().enumerate() {
        for inverted in [false, true] {
            for protocol in [None, Some(signal)] {
                let form = number as u64;
                let seed = seed << 16 | form << 8 | u64::from(inverted) << 1;
                let mut run = Run {
                    wire: Wire::new(Ear::new(protocol), TICK_HZ, seed),
                    inverted,
                    form,
                    frames: 0,
                };
                while run.wire.listener.edges < RUN_EDGES {
                    burst(&mut run, protocol);
                    let frames = run.wire.events.iter();
                    let frames = frames.filter(|(_, event)| *event != Event::Bad);
                    run.frames += frames.count() as u64;
                    run.wire.events.clear();
                }
                outcome.bad += u64::from(run.wire.listener.input.bad_frames());
                outcome.frames += run.frames;
                assert!(arms(&mut run.wire, signal), "{}", signal.name());
            }
        }
    }
    outcome
}

/// Returns whether zero throttle of this signal arms the wire, after a rest and within a second.
fn arms(wire: &mut Wire<Ear>, signal: Signal) -> bool {
    wire.listener.noise = false;
    wire.rest_at(signal.rests_high());
    wire.wait_until(wire.now_ps + 200_000 * PS_PER_US);
    let end_ps = wire.now_ps + 1_000_000 * PS_PER_US;
    while wire.now_ps < end_ps && !wire.listener.armed() {
        let next_ps = wire.now_ps + least_period_ns(signal) * PS_PER_NS;
        match signal {
            Signal::Dshot {
                rate,
                bidirectional,
            } => wire.frame(rate, bidirectional, 0),
            Signal::Pulse(kind) => wire.pulse(kind.end_points_ns().least.into()),
        }
        wire.wait_until(next_ps);
    }
    wire.listener.armed()
}

#[test]
fn edges_at_random_times() {
    let outcome = play(1, |run, _| {
        // Up to 1, 3.5, 12, 60, 500 or 3000 µs apart, with an occasional rest.
        let longest_ns = [1_000, 3_500, 12_000, 60_000, 500_000, 3_000_000][run.form as usize % 6];
        let mut level = true;
        for _ in 0..32 {
            let after_ps = run.wire.chance.below(longest_ns * PS_PER_NS);
            run.edge(after_ps, level);
            // One edge in 100 is missed.
            level ^= !run.wire.chance.once_in(100);
        }
        run.wire.now_ps += 20 * PS_PER_US;
    });
    assert!(outcome.bad > EDGES / 64, "{}", outcome.bad);
    // Some widths are those of pulses.
    assert!(outcome.frames > 10_000, "{}", outcome.frames);
}

#[test]
fn well_timed_random_words() {
    let outcome = play(2, |run, protocol| {
        let rate = run.rate(protocol);
        let bits = run.wire.chance.next() as u16;
        run.word(bits, rate);
    });
    assert!(outcome.bad > EDGES / 64, "{}", outcome.bad);
    // One word in sixteen has a correct checksum. It is heard if its rate was forced and its polarity is
    // right: in a third of the runs with a forced signal.
    let heard = EDGES / 32 / 2 / 3;
    let share = outcome.frames as f64 / heard as f64;
    assert!((share - 1.0 / 16.0).abs() < 0.01, "{share}");
}

#[test]
fn zero_frames_with_wrong_bits() {
    let zero = Frame {
        value: 0,
        telemetry: false,
    };
    let outcome = play(3, |run, protocol| {
        let mut wrong = 0_u16;
        let count = run.wire.chance.between(1, 7) as u32;
        while wrong.count_ones() < count {
            wrong |= 1 << run.wire.chance.below(16);
        }
        let rate = run.rate(protocol);
        run.word(zero.to_bits() ^ wrong, rate);
    });
    assert!(outcome.bad > EDGES / 64, "{}", outcome.bad);
    assert!(outcome.frames > 1_000, "{}", outcome.frames);
}

#[test]
fn bursts_at_the_rate_of_a_motor() {
    let outcome = play(4, |run, _| {
        // For a while at one rate and with one duty: each phase switches twice a period.
        let period_ps = 1_000_000 * PS_PER_US / run.wire.chance.between(8_000, 60_001);
        let mut instants = [0; 6].map(|_| run.wire.chance.below(period_ps));
        instants.sort_unstable();
        let switching = run.wire.chance.between(1, 7) as usize;
        let mut level = false;
        for _ in 0..run.wire.chance.between(1, 100) {
            let start_ps = run.wire.now_ps;
            for instant_ps in &instants[..switching] {
                run.wire.now_ps = run.wire.now_ps.max(start_ps + instant_ps);
                // The line rings and returns to its level, with few exceptions.
                let rings = 2 * run.wire.chance.between(1, 4);
                let edges = rings - u64::from(run.wire.chance.once_in(50));
                for _ in 0..edges {
                    level = !level;
                    let after_ps = run.wire.chance.between(30, 1_001) * PS_PER_NS;
                    run.edge(after_ps, level);
                }
            }
            run.wire.now_ps = run.wire.now_ps.max(start_ps + period_ps);
        }
        if level {
            run.edge(PS_PER_US, false);
        }
    });
    assert!(outcome.bad > EDGES / 128, "{}", outcome.bad);
    assert!(outcome.frames > 0);
}
