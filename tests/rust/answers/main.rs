//! The ESC's answers on a bidirectional wire, frame by frame: when they come, what they say, and that it is
//! true.

mod flight;
mod reply;

use flight::{Answered, DSHOT600, Flight, KINDS, Kind};
use reply::Reply;
use siskin_control::drive::Snapshot;
use siskin_params::ParamId;

const STOP: u16 = 0;
const HALF: u16 = 1048;
const ESC_INFO: u16 = 6;
const EXTENDED_ON: u16 = 13;
const EXTENDED_OFF: u16 = 14;

/// The longest period that can be reported, µs; from half a step above it, the motor is reported at
/// standstill.
const LONGEST_US: f64 = 65_280.0;

fn forced(kind: Kind) -> [(ParamId, f32); 1] {
    [(ParamId::InpProto, kind.protocol.into())]
}

/// Returns the control's electrical period, µs. Its speed is in turns per 1/24 kHz period.
fn believed_us(snapshot: &Snapshot) -> f64 {
    1e6 / 24_000.0 / snapshot.speed.to_num::<f64>().abs()
}

/// Asserts that a reply other than extended telemetry holds the control's speed, to the nearest step.
fn tells_the_speed(answered: &Answered) {
    let believed_us = believed_us(&answered.snapshot);
    match answered.reply {
        Reply::Extended(..) => {}
        Reply::Stopped => assert!(believed_us >= LONGEST_US + 63.0, "{answered:?}"),
        Reply::Turn { period_us, step_us } => {
            let error_us = (f64::from(period_us) - believed_us).abs();
            // Single precision: one part in a few million.
            let resolution_us = f64::from(step_us) / 2.0 + believed_us * 1e-6;
            assert!(error_us <= resolution_us, "{answered:?}: {believed_us}");
        }
    }
}

/// The motor stands, starts, turns, brakes and stands, at every rate.
#[test]
fn every_frame_is_answered_in_time_with_the_speed() {
    for kind in KINDS {
        let mut flight = Flight::new(kind, &forced(kind));
        let mut answers = Vec::new();
        for (seconds, value) in [(0.35, STOP), (1.2, HALF), (0.5, STOP)] {
            let frames = flight.frames(seconds);
            answers.extend(flight.send(frames, value));
        }
        answers.iter().for_each(tells_the_speed);

        let told = |answered: &Answered| match answered.reply {
            Reply::Turn { period_us, .. } => Some(1e6 / f64::from(period_us)),
            _ => None,
        };
        let turning = flight.frames(0.35)..flight.frames(0.35 + 1.2);
        let last = &answers[turning.end - 100..turning.end];
        // 3150 rpm with 12 pole pairs is 630 Hz: 1587 µs per turn, reported in steps of 4.
        for answered in last {
            let told_hz = told(answered).expect("it turns");
            assert!((told_hz / 630.0 - 1.0).abs() < 0.01, "{answered:?}");
            assert!((told_hz / answered.true_hz - 1.0).abs() < 0.01);
        }
        let speeds: Vec<_> = answers.iter().filter_map(told).collect();
        let (slowest, fastest) = speeds
            .iter()
            .fold((f64::MAX, 0.0_f64), |(a, b), x| (a.min(*x), b.max(*x)));
        assert!(slowest < 100.0 && fastest > 600.0, "{slowest} to {fastest}");
        assert_eq!(answers[0].reply, Reply::Stopped);
    }
}

/// Nothing is answered before the signal is detected, and everything after.
#[test]
fn a_wire_that_is_found_out_is_answered_from_then_on() {
    for kind in KINDS {
        let mut flight = Flight::new(kind, &[]);
        let answers = flight.fly(flight.frames(0.5), STOP, false);
        let silent = answers.iter().take_while(|answer| answer.is_none()).count();
        assert!(
            (1..flight.frames(0.1)).contains(&silent),
            "{kind:?}: {silent} frames"
        );
        assert!(answers[silent..].iter().all(Option::is_some), "{kind:?}");
    }
}

#[test]
fn a_wire_that_is_not_bidirectional_is_not_answered() {
    let mut flight = Flight::new(DSHOT600, &[]);
    let mut edges = 0;
    for ms in 0..300_u64 {
        let now_ns = flight.device.now_ns();
        flight
            .device
            .wire()
            .play(now_ns, &[12, 0, 0])
            .expect("room");
        let mut look = Counter::default();
        flight
            .device
            .advance(now_ns + 1_000_000, |_, _| None, &mut look, &mut |_| {});
        assert_eq!(look.answers, 0, "at {ms} ms");
        edges += look.edges;
    }
    // The line first goes to its low rest level.
    assert_eq!(edges, 300 * 32 + 1);
}

#[derive(Default)]
struct Counter {
    edges: u32,
    answers: u32,
}

impl siskin_emulator::device::Onlooker for Counter {
    fn period(&mut self, _: f64, _: &siskin_emulator::rig::Period, _: &siskin_emulator::rig::Rig) {}

    fn edge(&mut self, _: u64, _: bool) {
        self.edges += 1;
    }

    fn answer(&mut self, _: u64, _: &[u8]) {
        self.answers += 1;
    }
}

/// Extended telemetry is announced, never comes twice in a row, comes at least once a second, and ends.
#[test]
fn extended_telemetry_keeps_its_rules() {
    let mut flight = Flight::new(DSHOT600, &forced(DSHOT600));
    let seconds = |seconds: f64| (seconds * 8000.0) as usize;
    flight.send(seconds(0.5), STOP);
    let on = flight.send(10, EXTENDED_ON);
    let words = |answers: &[Answered]| -> Vec<(usize, u16, u8)> {
        let words = answers.iter().enumerate();
        let words = words.filter_map(|(place, answered)| match answered.reply {
            Reply::Extended(kind, value) => Some((place, kind, value)),
            _ => None,
        });
        words.collect()
    };
    assert_eq!(words(&on), [(5, 0xE, 0x00)], "the sixth of ten");

    let mut answers = flight.send(seconds(1.2), STOP);
    answers.extend(flight.send(seconds(1.5), HALF));
    answers.extend(flight.send(seconds(0.8), STOP));
    answers.iter().for_each(tells_the_speed);
    let told = words(&answers);
    for pair in told.windows(2) {
        let gap = pair[1].0 - pair[0].0;
        assert!((2..8000).contains(&gap), "{pair:?}");
    }
    assert!(told[0].0 < 8000 && answers.len() - told[told.len() - 1].0 < 8000);
    for (kind, least, greatest) in [
        // The thermistor is warmer than 0 °C and below the limit; the bench has 24 V.
        (0x2, 15..=60, 15..=60),
        (0x4, 94..=98, 94..=98),
        (0x6, 0..=0, 1..=10),
        (0xC, 0..=0, 0..=0),
    ] {
        let values = told.iter().filter(|word| word.1 == kind).map(|word| word.2);
        let (low, high) = (values.clone().min(), values.max());
        assert!(
            least.contains(&low.expect("it was told")),
            "{kind:x}: {low:?}"
        );
        assert!(
            greatest.contains(&high.expect("it was told")),
            "{kind:x}: {high:?}"
        );
    }
    assert!(told.iter().any(|word| word.1 == 0xE));

    let off = flight.send(10, EXTENDED_OFF);
    assert_eq!(words(&off).last(), Some(&(5, 0xE, 0xFF)));
    assert_eq!(words(&flight.send(seconds(2.0), STOP)), []);
}

/// A fault shows as an error in the next status word.
#[test]
fn a_fault_is_told_by_the_status() {
    // The bench's 24 V exceed the limit from the start.
    let overrides = [forced(DSHOT600)[0], (ParamId::LimBusVMax, 20.0)];
    let mut flight = Flight::new(DSHOT600, &overrides);
    flight.send(400, STOP);
    flight.send(10, EXTENDED_ON);
    let answers = flight.send(8000, STOP);
    let errors = answers.iter().filter_map(|answered| match answered.reply {
        Reply::Extended(0xE, value) => Some(value & 0x20 != 0),
        _ => None,
    });
    assert_eq!(errors.collect::<Vec<_>>(), [true, true]);
}

/// Ten bytes with a correct checksum, once a millisecond at most.
#[test]
fn the_telemetry_bit_is_answered_on_the_serial_line() {
    let mut flight = Flight::new(DSHOT600, &forced(DSHOT600));
    flight.send(4000, STOP);
    flight.send(8000, HALF);
    assert!(flight.serial().is_empty(), "nobody has asked");
    let answers = flight.fly(800, HALF, true);
    assert!(answers.iter().all(Option::is_some), "on the wire as well");
    assert_eq!(flight.serial().len(), 100);
    for datagram in flight.serial() {
        assert_eq!((datagram[0], datagram.len()), (30, 11));
        let word = |place: usize| u16::from_be_bytes([datagram[place], datagram[place + 1]]);
        assert!((15..60).contains(&datagram[1]), "°C: {}", datagram[1]);
        assert!((2380..2420).contains(&word(2)), "0.01 V: {}", word(2));
        assert!((50..1000).contains(&word(4)), "0.01 A: {}", word(4));
        assert!(word(6) < 10, "mAh: {}", word(6));
        // 3150 rpm with 12 pole pairs.
        assert!((370..386).contains(&word(8)), "eRPM/100: {}", word(8));
        assert_eq!(remainder(&datagram[1..]), 0);
    }
}

/// The command for the ESC's information brings it once, on the serial line.
#[test]
fn the_information_is_sent_when_it_is_asked_for() {
    let mut flight = Flight::new(DSHOT600, &forced(DSHOT600));
    flight.send(4000, STOP);
    flight.send(10, ESC_INFO);
    flight.send(100, STOP);
    let [datagram] = flight.serial() else {
        panic!("{:?}", flight.serial());
    };
    assert_eq!((datagram[0], datagram.len()), (31, 65));
    assert_eq!(remainder(&datagram[1..]), 0);
}

/// Returns the bytes' remainder modulo x⁸ + x² + x + 1: 0 if the last one is their checksum.
fn remainder(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |rest, byte| {
        let mut rest = rest << 8 | u16::from(*byte);
        for bit in (8..16).rev() {
            if rest >> bit & 1 != 0 {
                rest ^= 0x107 << (bit - 8);
            }
        }
        rest
    })
}

/// The pin is an output while the ESC answers, so whatever the sender does meanwhile is not heard.
#[test]
fn the_esc_is_deaf_while_it_answers() {
    let mut flight = Flight::new(DSHOT600, &forced(DSHOT600));
    flight.send(100, STOP);
    // A zero frame by hand, with 1667 ns bits that are low for 625 ns; its last nibble is four ones.
    let mut durations: Vec<u32> = Vec::new();
    for bit in 0..16 {
        let low_ns = if bit < 12 { 625 } else { 1250 };
        durations.extend([low_ns, 1667 - low_ns]);
    }
    let spoil = |pause_ns: u32| {
        let mut durations = durations.clone();
        *durations.last_mut().expect("not empty") += pause_ns;
        // Two pulses that are not a frame.
        durations.extend([700, 1000, 700, 100_000]);
        durations
    };
    let bad = |flight: &Flight| flight.device.esc().telemetry().bad_frames;
    for (pause_ns, heard) in [(35_000, 0), (50_000, 0), (70_000, 1)] {
        let before = bad(&flight);
        flight.raw(0, &spoil(pause_ns));
        flight.raw(1, &[900_000]);
        assert_eq!(bad(&flight) - before, heard, "after {pause_ns} ns");
        flight.send(100, STOP);
    }
}
