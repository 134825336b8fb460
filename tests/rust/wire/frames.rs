//! A million frames of every signal from a sender with timing errors: each one is decoded correctly.

use siskin_throttle::dshot::{Frame, Rate};
use siskin_throttle::line::{Event, Line};
use siskin_throttle::signal::{Pulse, Signal};

use crate::sender::{SLOW_TICK_HZ, TICK_HZ, Wire, least_period_ns};

/// Frames of each signal, in runs that each have a clock of their own.
const RUNS: u64 = 1_000;
const RUN_FRAMES: u64 = 1_000;

const JITTER_NS: u64 = 60;

/// Returns a wire whose signal is known: forced in the first half of the runs, detected in the others.
fn known_wire(tick_hz: u32, signal: Signal, forced: bool) -> Wire<Line> {
    let mut wire = Wire::to_line(tick_hz, u64::from(signal.number()) << 1 | u64::from(forced));
    wire.rest_at(signal.rests_high());
    wire.now_ps = 1_000_000_000;
    if forced {
        wire.listener.force(Some(signal));
    }
    wire.errors.jitter_ns = JITTER_NS;
    for _ in 0..10 {
        let begun_ps = wire.now_ps;
        match signal {
            Signal::Dshot {
                rate,
                bidirectional,
            } => wire.frame(rate, bidirectional, 0),
            Signal::Pulse(kind) => wire.pulse(kind.end_points_ns().least.into()),
        }
        wire.wait_until(begun_ps + 10_000_000_000);
    }
    assert_eq!(wire.listener.signal(), Some(signal));
    wire.events.clear();
    wire
}

fn dshot_frames(tick_hz: u32, rate: Rate, bidirectional: bool) {
    let signal = Signal::Dshot {
        rate,
        bidirectional,
    };
    for forced in [true, false] {
        let mut wire = known_wire(tick_hz, signal, forced);
        for run in 0..RUNS / 2 {
            wire.errors.fast_permille = wire.chance.below(101) as i64 - 50;
            for _ in 0..RUN_FRAMES {
                let word = wire.chance.next();
                let frame = Frame {
                    value: word as u16 & 0x7FF,
                    telemetry: word & 0x800 != 0,
                };
                // Up to 16 µs beyond the two bits.
                wire.now_ps += word >> 40;
                let start_ps = wire.now_ps;
                wire.frame(rate, bidirectional, frame.to_bits());
                wire.settle();
                let heard = wire.events.as_slice();
                let &[
                    (
                        _,
                        event @ Event::Frame {
                            first_edge_ticks,
                            frame_ticks,
                            ..
                        },
                    ),
                ] = heard
                else {
                    panic!("{}, run {run}: {heard:?}", signal.name());
                };
                let wanted = Event::Frame {
                    rate,
                    bidirectional,
                    frame,
                    first_edge_ticks,
                    frame_ticks,
                };
                assert_eq!(event, wanted, "{}, run {run}", signal.name());
                let start_ticks = wire.ticks(start_ps) as u32;
                let strayed = start_ticks.wrapping_sub(first_edge_ticks) as i32;
                assert!(strayed.unsigned_abs() <= wire.ticks(JITTER_NS * 1000) as u32 + 1);
                wire.events.clear();
            }
        }
    }
}

fn pulses(tick_hz: u32, kind: Pulse) {
    let signal = Signal::Pulse(kind);
    let end_points = kind.end_points_ns();
    let period_ps = least_period_ns(signal) * 1000;
    // Both edges have jitter, and each is seen up to a tick late.
    let allowed_ns = 2 * JITTER_NS + u64::from(1_000_000_000 / tick_hz) + 1;
    for forced in [true, false] {
        let mut wire = known_wire(tick_hz, signal, forced);
        for run in 0..RUNS / 2 {
            wire.errors.fast_permille = wire.chance.below(101) as i64 - 50;
            for _ in 0..RUN_FRAMES {
                let width_ns = wire
                    .chance
                    .between(end_points.least.into(), u64::from(end_points.most) + 1);
                let begun_ps = wire.now_ps;
                wire.pulse(width_ns);
                wire.settle();
                let heard = wire.events.as_slice();
                let &[
                    (
                        _,
                        Event::Pulse {
                            kind: found,
                            width_ns: measured_ns,
                            ..
                        },
                    ),
                ] = heard
                else {
                    panic!("{}, run {run}: {heard:?}", signal.name());
                };
                assert_eq!(found, kind);
                let sent_ns = wire.sent(width_ns * 1000) / 1000;
                let strayed_ns = sent_ns.abs_diff(measured_ns.into());
                assert!(strayed_ns <= allowed_ns, "{width_ns}: {measured_ns}");
                wire.events.clear();
                let next_ps = begun_ps + period_ps + wire.chance.below(period_ps / 4);
                wire.now_ps = wire.now_ps.max(next_ps);
            }
        }
    }
}

/// A test per signal, so that they share the processors.
macro_rules! million {
    ($($test:ident: $play:ident($($argument:expr),*);)*) => {$(
        #[test]
        fn $test() {
            $play(TICK_HZ, $($argument),*);
        }
    )*};
}

million! {
    a_million_dshot150: dshot_frames(Rate::Dshot150, false);
    a_million_dshot300: dshot_frames(Rate::Dshot300, false);
    a_million_dshot600: dshot_frames(Rate::Dshot600, false);
    a_million_dshot1200: dshot_frames(Rate::Dshot1200, false);
    a_million_bidirectional_dshot150: dshot_frames(Rate::Dshot150, true);
    a_million_bidirectional_dshot300: dshot_frames(Rate::Dshot300, true);
    a_million_bidirectional_dshot600: dshot_frames(Rate::Dshot600, true);
    a_million_bidirectional_dshot1200: dshot_frames(Rate::Dshot1200, true);
    a_million_servo_pulses: pulses(Pulse::Servo);
    a_million_oneshot125_pulses: pulses(Pulse::OneShot125);
    a_million_oneshot42_pulses: pulses(Pulse::OneShot42);
    a_million_multishot_pulses: pulses(Pulse::Multishot);
}

#[test]
fn a_million_dshot1200_on_the_slow_timer() {
    dshot_frames(SLOW_TICK_HZ, Rate::Dshot1200, true);
}

/// Every frame with each single bit wrong, next to correct ones.
#[test]
fn a_single_wrong_bit_is_rejected_and_changes_nothing() {
    for signal in Signal::all() {
        let Signal::Dshot {
            rate,
            bidirectional,
        } = signal
        else {
            continue;
        };
        let mut wire = known_wire(TICK_HZ, signal, true);
        for data in 0..1_u16 << 12 {
            let frame = Frame {
                value: data >> 1,
                telemetry: data & 1 != 0,
            };
            wire.frame(rate, bidirectional, frame.to_bits());
            for wrong in 0..16 {
                wire.frame(rate, bidirectional, frame.to_bits() ^ 1 << wrong);
            }
            wire.settle();
            let frames = wire.events.iter().filter_map(|(_, event)| match event {
                Event::Frame { frame, .. } => Some(*frame),
                _ => None,
            });
            assert!(frames.eq([frame]), "{}, {frame:?}", signal.name());
            let bad = wire.events.iter().filter(|(_, event)| *event == Event::Bad);
            assert_eq!(bad.count(), 16, "{}, {frame:?}", signal.name());
            wire.events.clear();
        }
    }
}
