//! Edges to the nanosecond, and datagrams of any content.

mod errors;

use siskin_throttle::line::{Event, Line};
use siskin_throttle::signal::{Pulse, Signal};

use super::*;
use proptest::prelude::*;

fn edges(wire: &mut Wire) -> Vec<(u64, bool)> {
    std::iter::from_fn(|| wire.next_edge(u64::MAX / 2)).collect()
}

/// Returns the edges of one datagram on a wire that has been silent, from 1000 ns on.
fn alone(datagram: &[u8]) -> Vec<(u64, bool)> {
    let mut wire = Wire::detached();
    wire.play(1000, datagram).unwrap();
    edges(&mut wire)
}

fn dshot(protocol: u8, bits: u16) -> [u8; 3] {
    let [low, high] = bits.to_le_bytes();
    [protocol, low, high]
}

fn pulse(protocol: u8, width_ns: u32) -> Vec<u8> {
    let mut datagram = vec![protocol];
    datagram.extend(width_ns.to_le_bytes());
    datagram
}

fn raw(first: u8, durations_ns: &[u32]) -> Vec<u8> {
    let mut datagram = vec![255, first];
    datagram.extend(durations_ns.iter().flat_map(|d| d.to_le_bytes()));
    datagram
}

#[test]
fn pulses_are_high_for_their_width() {
    for protocol in 0..=3 {
        assert_eq!(
            alone(&pulse(protocol, 1_500_123)),
            [(1000, true), (1_501_123, false)]
        );
        assert_eq!(alone(&pulse(protocol, 1)), [(1000, true), (1001, false)]);
    }
}

#[test]
fn dshot_has_its_nominal_times() {
    // T1H and T0H of the protocol, ns, and the bit time; 0x8001 has ones at both ends.
    for (rate, t1h, t0h, bit) in [
        (0, 5000.0, 2500.0, 20_000.0 / 3.0),
        (1, 2500.0, 1250.0, 10_000.0 / 3.0),
        (2, 1250.0, 625.0, 5000.0 / 3.0),
        (3, 625.0, 312.5, 2500.0 / 3.0),
    ] {
        let normal = alone(&dshot(10 + rate, 0x8001));
        assert_eq!(normal.len(), 32);
        for (i, (time_ns, level)) in normal.iter().enumerate() {
            let width = match i / 2 {
                0 | 15 => t1h,
                _ => t0h,
            };
            let exact = 1000.0 + (i / 2) as f64 * bit + (i % 2) as f64 * width;
            assert!(
                (*time_ns as f64 - exact).abs() <= 0.5,
                "{rate}: edge {i} at {time_ns}"
            );
            assert_eq!(*level, i % 2 == 0);
        }

        // The other polarity rests high: the line gets there four bits earlier.
        let inverted = alone(&dshot(20 + rate, 0x8001));
        assert_eq!(inverted[0], (1000, true));
        let rest = inverted[1].0 - 1000;
        assert!((rest as f64 - 4.0 * bit).abs() <= 0.5, "{rest}");
        let upside_down: Vec<_> = normal.iter().map(|(t, level)| (t + rest, !level)).collect();
        assert_eq!(inverted[1..], upside_down);
    }
    let frame = alone(&dshot(12, 0xFFFF));
    assert_eq!(
        frame[..4],
        [(1000, true), (2250, false), (2667, true), (3917, false)]
    );
    assert_eq!(frame[31], (1000 + 26_250, false));
}

#[test]
fn frames_that_come_too_early_wait_their_turn() {
    let mut wire = Wire::detached();
    wire.play(0, &dshot(12, 0)).unwrap();
    wire.play(10, &dshot(12, 0)).unwrap();
    let found = edges(&mut wire);
    assert_eq!(found.len(), 64);
    // 16 bits of the frame and 4 of rest: the second starts 20 bit times after the first.
    assert_eq!(found[32], (26_667 + 6667, true));

    // The longer rest counts, whichever frame requires it.
    for (first, second, end_ns) in [(10, 12, 106_667), (12, 10, 26_667)] {
        let mut wire = Wire::detached();
        wire.play(0, &dshot(first, 0)).unwrap();
        wire.play(0, &dshot(second, 0)).unwrap();
        assert_eq!(edges(&mut wire)[32], (end_ns + 26_667, true));
    }

    // After the rest a frame starts on arrival.
    wire.play(90_000, &dshot(12, 0)).unwrap();
    assert_eq!(wire.next_edge(u64::MAX).map(|edge| edge.1), Some(true));
}

#[test]
fn a_bidirectional_frame_leaves_time_for_its_answer() {
    let mut wire = Wire::detached();
    wire.play(0, &dshot(22, 0)).unwrap();
    wire.play(0, &dshot(22, 0)).unwrap();
    let found = edges(&mut wire);
    let (first, second) = (found[1].0, found[33].0);
    // Frame, 30 µs and 21 bits at 750 kbit/s, then four bits of rest.
    assert_eq!(second - first, 26_667 + 30_000 + 28_000 + 6667);

    // Back to the other polarity: down, rest, frame.
    wire.play(1_000_000_000, &dshot(12, 0)).unwrap();
    assert_eq!(wire.edges.len(), 33);
}

#[test]
fn a_pulse_rests_for_a_sixteenth_of_it() {
    let mut wire = Wire::detached();
    wire.play(0, &pulse(0, 2_000_000)).unwrap();
    wire.play(0, &pulse(3, 5000)).unwrap();
    wire.play(0, &pulse(3, 5000)).unwrap();
    let starts: Vec<_> = edges(&mut wire).iter().step_by(2).map(|e| e.0).collect();
    assert_eq!(starts, [0, 2_125_000, 2_156_250]);
}

/// However many come at once, the ESC sees each as a pulse: 5 to 25 µs, at 32 kHz at most.
#[test]
fn queued_multishot_pulses_are_decoded() {
    const TICK_HZ: u64 = 170_000_000;
    let widths_ns = [5_000, 5_000, 25_000, 12_345, 25_000, 5_000];
    let mut wire = Wire::detached();
    for width_ns in widths_ns {
        wire.play(0, &pulse(3, width_ns)).unwrap();
    }
    let mut line = Line::new(TICK_HZ as u32);
    line.force(Some(Signal::Pulse(Pulse::Multishot)));
    let ticks = |time_ns: u64| (time_ns * TICK_HZ / 1_000_000_000) as u32;
    let mut events: Vec<_> = edges(&mut wire)
        .iter()
        .filter_map(|(time_ns, level)| line.edge(ticks(*time_ns), *level))
        .collect();
    events.extend(line.settle(ticks(1_000_000)));
    assert_eq!(events.len(), widths_ns.len());
    for (event, sent_ns) in events.iter().zip(widths_ns) {
        assert!(
            matches!(event, Event::Pulse { width_ns, .. } if width_ns.abs_diff(sent_ns) <= 6),
            "{event:?} for {sent_ns} ns"
        );
    }
}

#[test]
fn raw_levels_join_and_the_last_one_stays() {
    let mut wire = Wire::detached();
    wire.play(0, &raw(1, &[100, 50])).unwrap();
    // Low again at first: no edge between. Then high to stay.
    wire.play(0, &raw(0, &[25, 10])).unwrap();
    assert_eq!(edges(&mut wire), [(0, true), (100, false), (175, true)]);

    // High until something comes: more of it makes no edge.
    wire = Wire::detached();
    wire.play(0, &raw(1, &[10])).unwrap();
    wire.play(1_000_000, &raw(1, &[10])).unwrap();
    wire.play(2_000_000, &raw(0, &[10])).unwrap();
    assert_eq!(edges(&mut wire), [(0, true), (2_000_000, false)]);

    // A level of 0 ns does not count, whether between two or at the end of a datagram.
    assert_eq!(
        alone(&raw(1, &[10, 0, 10, 5])),
        [(1000, true), (1020, false)]
    );
    assert_eq!(alone(&raw(1, &[0, 7, 3])), [(1007, true)]);
    let mut wire = Wire::detached();
    wire.play(0, &raw(1, &[10, 0])).unwrap();
    wire.play(0, &raw(1, &[5, 1])).unwrap();
    assert_eq!(edges(&mut wire), [(0, true), (15, false)]);
}

#[test]
fn a_frame_on_a_line_left_high_comes_to_rest_first() {
    let mut wire = Wire::detached();
    wire.play(0, &raw(1, &[10])).unwrap();
    wire.play(1_000_000, &dshot(12, 0)).unwrap();
    let found = edges(&mut wire);
    assert_eq!(found.len(), 34);
    assert_eq!(found[1..3], [(1_000_000, false), (1_006_667, true)]);
}

#[test]
fn backlog_beyond_100_ms_is_dropped_and_counted() {
    let mut wire = Wire::detached();
    // A pulse takes 1.0625 ms with its rest: the 96th waits 100.9 ms.
    let results: Vec<_> = (0..200)
        .map(|_| wire.play(0, &pulse(0, 1_000_000)))
        .collect();
    assert!(results[..95].iter().all(Result::is_ok));
    assert!(results[95..].iter().all(|r| *r == Err(Rejected::Backlog)));
    let counts = WireCounts {
        played: 95,
        rejected: 0,
        dropped: 105,
    };
    assert_eq!(wire.counts(), counts);
    // A millisecond later there is room for one.
    assert_eq!(wire.play(1_000_000, &pulse(0, 1_000_000)), Ok(()));
    assert_eq!(
        wire.play(1_000_000, &pulse(0, 1_000_000)),
        Err(Rejected::Backlog)
    );

    // On a silent line one datagram may last longer than that.
    assert_eq!(alone(&raw(1, &[200_000_000, 1])).len(), 2);
    // Levels of 1 ns do not fill the memory.
    let mut wire = Wire::detached();
    let short = raw(1, &[1; 16_000]);
    let played = (0..100).filter(|_| wire.play(0, &short).is_ok()).count();
    assert_eq!(played, 16);
}

#[test]
fn edges_come_before_the_time_asked_for() {
    let mut wire = Wire::detached();
    wire.play(5, &pulse(0, 10)).unwrap();
    assert_eq!(wire.next_edge(5), None);
    assert_eq!(wire.next_edge(6), Some((5, true)));
    assert_eq!(wire.next_edge(15), None);
    // The slice up to 40 000 is over: a late arrival is played from there.
    assert_eq!(wire.next_edge(40_000), Some((15, false)));
    assert_eq!(wire.next_edge(40_000), None);
    wire.play(39_900, &pulse(0, 10)).unwrap();
    assert_eq!(wire.next_edge(41_000), Some((40_000, true)));
}

#[test]
fn malformed_datagrams_are_counted() {
    let mut wire = Wire::detached();
    let length = |protocol, length| Rejected::Length { protocol, length };
    for (datagram, wanted) in [
        (vec![], Rejected::Empty),
        (vec![4, 0, 0], Rejected::Protocol(4)),
        (vec![14, 0, 0], Rejected::Protocol(14)),
        (vec![30, 0, 0], Rejected::Protocol(30)),
        (vec![0, 1, 2, 3], length(0, 4)),
        (pulse(3, 0), Rejected::NoPulse),
        (vec![12, 0], length(12, 2)),
        (vec![23, 0, 0, 0], length(23, 4)),
        (vec![255], length(255, 1)),
        (vec![255, 1], length(255, 2)),
        (vec![255, 1, 1, 0, 0], length(255, 5)),
        (raw(2, &[1]), Rejected::Level(2)),
        (raw(1, &[u32::MAX; 3]), Rejected::TooLong(12_884_901_885)),
    ] {
        assert_eq!(wire.play(0, &datagram), Err(wanted), "{datagram:?}");
    }
    let counts = WireCounts {
        rejected: 13,
        ..WireCounts::default()
    };
    assert_eq!(wire.counts(), counts);
    assert_eq!(edges(&mut wire), []);
}

/// Polls until this many datagrams have been played, or it has taken too long.
fn poll(wire: &mut Wire, now_ns: u64, played: u64) {
    for _ in 0..5000 {
        wire.poll(now_ns);
        if wire.counts().played == played {
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Opens a socket whose silence fails a test.
fn sender() -> UdpSocket {
    let sender = UdpSocket::bind("127.0.0.1:0").unwrap();
    let patience = Duration::from_secs(5);
    sender.set_read_timeout(Some(patience)).unwrap();
    sender
}

#[test]
fn datagrams_come_in_by_udp() {
    let address: SignalAddress = "udp:127.0.0.1:0".parse().unwrap();
    let mut wire = Wire::open(&address, 3).unwrap();
    let to = wire.local_address().unwrap();
    let sender = sender();
    wire.poll(0);
    assert_eq!(wire.counts(), WireCounts::default());
    // There is nobody to answer yet.
    wire.send(0, &[1]);
    sender.send_to(&[99], to).unwrap();
    sender.send_to(&dshot(12, 0x1234), to).unwrap();
    // Longer than any frame, and as long as a datagram can be.
    sender.send_to(&raw(1, &[1000; 16_000]), to).unwrap();
    poll(&mut wire, 777, 2);
    let counts = WireCounts {
        played: 2,
        rejected: 1,
        dropped: 0,
    };
    assert_eq!(wire.counts(), counts);
    wire.send(777, &[2, 3]);
    let mut answer = [0; 8];
    assert_eq!(sender.recv_from(&mut answer).unwrap(), (2, to));
    assert_eq!(answer[..2], [2, 3]);
    assert_eq!(edges(&mut wire).len(), 32 + 16_000);

    // The port is taken now.
    let taken: SignalAddress = format!("udp:{to}").parse().unwrap();
    let line = Wire::open(&taken, 0).err().expect("taken").to_string();
    assert!(
        line.contains(&taken.to_string()) && line.contains("is taken"),
        "{line}"
    );
}

#[test]
fn an_answer_goes_to_who_has_asked() {
    let mut wire = Wire::open(&"udp:127.0.0.1:0".parse().unwrap(), 0).unwrap();
    let to = wire.local_address().unwrap();
    let senders = [sender(), sender()];
    for (place, sender) in senders.iter().enumerate() {
        sender.send_to(&dshot(22, 0), to).unwrap();
        poll(&mut wire, 0, place as u64 + 1);
    }
    // Both wait in the queue; the second begins when the first has been answered.
    let edges = edges(&mut wire);
    let begins_ns = [edges[1].0, edges[33].0];
    for (sender, asked_ns) in senders.iter().zip(begins_ns) {
        wire.send(asked_ns, &asked_ns.to_le_bytes());
        let mut answer = [0; 8];
        sender.recv_from(&mut answer).unwrap();
        assert_eq!(answer, asked_ns.to_le_bytes());
    }
}

/// Unanswered frames leave no trace, however often the sender changes.
#[test]
fn senders_are_forgotten() {
    let mut wire = Wire::open(&"udp:127.0.0.1:0".parse().unwrap(), 0).unwrap();
    let to = wire.local_address().unwrap();
    let senders = [sender(), sender()];
    for number in 0..100 {
        let sender = &senders[number % 2];
        sender.send_to(&dshot(12, 0), to).unwrap();
        poll(&mut wire, number as u64 * 1_000_000, number as u64 + 1);
        while wire
            .next_edge(number as u64 * 1_000_000 + 900_000)
            .is_some()
        {}
        assert!(wire.senders.len() <= 3, "{}", wire.senders.len());
    }
}

#[test]
fn addresses_are_read() {
    let address: SignalAddress = "udp:[::1]:65535".parse().unwrap();
    assert_eq!(address.to_string(), "udp:[::1]:65535");
    let line = Wire::open(&address, 1).err().expect("no port").to_string();
    assert!(line.contains("ESC 1 would be above port 65535"), "{line}");
    for text in [
        "",
        "127.0.0.1:1",
        "tcp:127.0.0.1:1",
        "udp:127.0.0.1",
        "udp:1:2:3",
    ] {
        let line = text.parse::<SignalAddress>().unwrap_err().to_string();
        assert!(
            line.contains(&format!("'{text}'")) && line.contains("use udp:"),
            "{line}"
        );
        assert!(!line.contains('\n'), "{line}");
    }
}

/// Bytes that are sometimes the start of something valid.
fn datagram() -> impl Strategy<Value = Vec<u8>> {
    let protocol = prop::sample::select(vec![0_u8, 3, 10, 13, 20, 23, 255]);
    prop_oneof![
        prop::collection::vec(any::<u8>(), 0..40),
        (
            protocol,
            any::<u8>(),
            prop::collection::vec(any::<u8>(), 0..40)
        )
            .prop_map(|(protocol, first, rest)| [&[protocol, first & 1], &rest[..]].concat()),
        prop::collection::vec(0..300_000_u32, 1..20).prop_map(|durations| raw(1, &durations)),
        (10..14_u8, any::<u16>(), any::<bool>()).prop_map(|(p, bits, inverted)| dshot(
            p + 10 * u8::from(inverted),
            bits
        )
        .to_vec()),
    ]
}

proptest! {
    #[test]
    fn whatever_comes_edges_alternate_in_order(
        datagrams in prop::collection::vec((0..500_000_u64, datagram()), 0..30),
        start_ns in prop_oneof![Just(0), Just(u64::MAX - 1000), any::<u64>()],
    ) {
        let mut wire = Wire::detached();
        let (mut now_ns, mut last) = (start_ns, None);
        let mut check = |edge: Option<(u64, bool)>, before_ns: u64, now_ns: u64| {
            let Some((time_ns, level)) = edge else { return Ok(false) };
            prop_assert!(time_ns >= start_ns && time_ns < before_ns);
            if let Some((last_ns, last_level)) = last {
                prop_assert!(time_ns > last_ns && level != last_level);
                prop_assert!(time_ns < now_ns.saturating_add(11_000_000_000));
            } else {
                prop_assert!(level, "the line starts low");
            }
            last = Some((time_ns, level));
            Ok(true)
        };
        for (wait_ns, datagram) in &datagrams {
            now_ns = now_ns.saturating_add(*wait_ns);
            while check(wire.next_edge(now_ns), now_ns, now_ns)? {}
            // Refusals are counted below.
            let _ = wire.play(now_ns, datagram);
        }
        while check(wire.next_edge(u64::MAX), u64::MAX, now_ns)? {}
        let WireCounts { played, rejected, dropped } = wire.counts();
        prop_assert_eq!(played + rejected + dropped, datagrams.len() as u64);
    }
}
