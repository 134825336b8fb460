//! The motor follows what the flight controller sends, and its replies tell the speed. Run with `--release`.

use siskin_throttle::answer::{REPLY_DELAY_NS, gcr};

use crate::common::{
    BIDIRECTIONAL_300, BIDIRECTIONAL_600, BIDIRECTIONAL_1200, Board, MS, Throttle, US, image,
};
use crate::flight_controller::{Exchange, FlightController};
use mavlink::dialects::ardupilotmega::{PARAM_REQUEST_LIST_DATA, PARAM_VALUE_DATA};
use siskin_emulator::machine::Machine as _;
use siskin_vboard::chip::Cause;

/// Returns the period in a reply, µs: `eeemmmmmmmmm`, m·2^e; `None` at standstill.
fn period_us(bits: u32) -> Option<u32> {
    let data = gcr::decode(bits).expect("a reply that decodes");
    (data != 0xfff).then(|| u32::from(data & 0x1ff) << (data >> 9))
}

/// Checks the replies over a time: each frame has one, on time, with the plant's speed.
fn answered(board: &mut Board, for_ns: u64) {
    let pole_pairs = f64::from(board.world().bench().bench().motor.pole_pairs);
    let (played, replied) = (board.played, board.heard.replies.len());
    board.run(for_ns);
    // The last one's reply may still be on the wire.
    board.run(MS / 10);
    let frames = board.played - played;
    let replies = board.heard.replies[replied..].to_vec();
    let times = replies.iter().map(|reply| reply.after_ns);
    println!(
        "{} frames, {} replies, {:?} to {:?} ns after the frame",
        frames,
        replies.len(),
        times.clone().min(),
        times.clone().max()
    );
    assert!(replies.len().abs_diff(frames) <= 1);
    for after_ns in times {
        assert!(after_ns.abs_diff(REPLY_DELAY_NS) <= 2_000, "{after_ns} ns");
    }
    for reply in &replies {
        period_us(reply.bits);
    }
    let told_us = replies.last().and_then(|reply| period_us(reply.bits));
    let told = 60e6 / f64::from(told_us.expect("it turns"));
    let turns = board.rpm() * pole_pairs;
    // A word has 8 or 9 bits; the control's estimate is off by a few tenths of a percent.
    assert!((told / turns - 1.0).abs() < 0.02, "{told} of {turns} eRPM");
}

#[test]
fn each_frame_is_answered_at_its_time() {
    let mut board = Board::new(&image(), &[]);
    board.spin_up();
    board.run(1_000 * MS);
    answered(&mut board, 200 * MS);
    board.heard.frames.clear();
    let Throttle::Dshot(_) = board.throttle else {
        panic!("it is driven by DShot");
    };
    let (target_system, target_component) = (board.heard.from.system, board.heard.from.component);
    board.send(&PARAM_REQUEST_LIST_DATA {
        target_system,
        target_component,
    });
    answered(&mut board, 300 * MS);
    let values = board.heard.messages::<PARAM_VALUE_DATA>();
    println!("{} values meanwhile", values.len());
    assert!(values.len() > 20, "{}", values.len());
}

/// DShot arms it and turns it at a speed set by the throttle, without a fault.
#[test]
fn dshot_turns_the_motor() {
    let mut board = Board::new(&image(), &[]);
    board.spin_up();
    board.run(1_500 * MS);
    let half = board.rpm();
    board.throttle = Throttle::Dshot(1500);
    board.run(1_000 * MS);
    let more = board.rpm();
    board.throttle = Throttle::Dshot(0);
    board.run(500 * MS);
    println!(
        "{half:.0} rpm at 1000, {more:.0} at 1500, {:?}",
        board.heard.texts()
    );
    let texts = board.heard.texts();
    assert!(
        !texts.iter().any(|text| text.contains("Fault")),
        "{texts:?}"
    );
    // The speed is as commanded: CTL_RPM_MIN to CTL_RPM_MAX over 48 to 2047.
    for (rpm, value) in [(half, 1000.0), (more, 1500.0)] {
        let commanded = 300.0 + 5700.0 * (value - 48.0) / 1999.0;
        assert!((rpm / commanded - 1.0).abs() < 0.03, "{rpm} of {commanded}");
    }
    assert_eq!(board.world().bridge().violations(), 0);
}

#[test]
fn pulses_turn_the_motor() {
    let mut board = Board::new(&image(), &[]);
    board.throttle = Throttle::Pulse(1_000_000);
    board.run(1_000 * MS);
    board.throttle = Throttle::Pulse(1_500_000);
    let fast = board.run_until(10 * MS, 4_000 * MS, |board| board.rpm() > 1500.0);
    println!("1500 rpm after {fast:?} ns, {:?}", board.heard.texts());
    assert!(fast.is_some(), "{} rpm", board.rpm());
    assert_eq!(board.world().bridge().violations(), 0);
}

/// Full throttle from power-up, held, and then none teach the end points. After any other reset they teach nothing.
#[test]
fn the_stick_calibrates_after_a_power_up_alone() {
    for (cause, calibrates) in [
        (Cause::Power, true),
        (Cause::Software, false),
        (Cause::Pin, false),
    ] {
        let mut board = Board::new(&image(), &[]);
        board.throttle = Throttle::Pulse(1_900_000);
        board.run(200 * MS);
        board.reset(cause);
        board.heard.frames.clear();
        board.run(3_000 * MS);
        board.throttle = Throttle::Pulse(1_100_000);
        board.run(2_000 * MS);
        let texts = board.heard.texts();
        let calibrated = texts.iter().any(|text| text.contains("calibrat"));
        assert_eq!(calibrated, calibrates, "{cause:?}: {texts:?}");
    }
}

/// Zero throttle frames at 4 kHz, a sixth of the PWM frequency, starting anywhere in the board's start. At
/// DShot150 that would leave 1.3 µs between a reply's end and the next frame.
#[test]
fn a_signal_of_4_khz_is_found_out_and_answered() {
    for (protocol, bit_hz, name) in [
        (BIDIRECTIONAL_300, 300e3, "bidirectional DShot300"),
        (BIDIRECTIONAL_600, 600e3, "bidirectional DShot600"),
        (BIDIRECTIONAL_1200, 1.2e6, "bidirectional DShot1200"),
    ] {
        for begin_us in [0, 20_007, 40_018, 60_031] {
            let mut board = Board::new(&image(), &[]);
            board.protocol = protocol;
            board.run(begin_us * US);
            let controller = FlightController { bit_hz };
            let exchanges = controller.fly(&mut board, 0, 3200, |_| 250_000.0);
            let answered = |exchanges: &[Exchange]| {
                exchanges
                    .iter()
                    .filter(|exchange| exchange.word().is_some())
                    .count()
            };
            // A signal is known after 50 ms of frames at the earliest; until then the wire is the sender's.
            assert_eq!(answered(&exchanges[..190]), 0, "{name}: not known yet");
            let late = answered(&exchanges[2400..]);
            let texts = board.heard.texts();
            println!("{name} from {begin_us} us: {late} of the last 800 are answered; {texts:?}");
            assert!(texts.contains(&format!("Throttle: {name}")), "{texts:?}");
            assert!(late >= 790, "{late}");
        }
    }
}

/// Bits shorter by a fifth, longer by a ninth and by a third: each is found out and answered by the sender's clock.
#[test]
fn a_sender_whose_clock_is_off_is_answered_at_its_rate() {
    for bit in [0.8, 1.114, 1.33] {
        let mut board = Board::new(&image(), &[]);
        board.protocol = BIDIRECTIONAL_600;
        let controller = FlightController {
            bit_hz: 600e3 / bit,
        };
        let exchanges = controller.fly(&mut board, 0, 1_000, |_| 500_000.0);
        let answered = |exchange: &&Exchange| exchange.word().is_some();
        let late = exchanges[600..].iter().filter(answered).count();
        println!("bits of {bit}: {late} of the last 400 are answered");
        let texts = board.heard.texts();
        let name = "Throttle: bidirectional DShot600";
        assert!(texts.iter().any(|text| text == name), "{texts:?}");
        assert!(late >= 398, "{bit}: {late}");
    }
}

/// Plays 200 ms of DShot frames of zero throttle with a telemetry request, at 4 kHz: bits of these lengths, a zero and a
/// one's high levels, and in the middle of each low level a spike.
fn found_out([bit_ns, zero_ns, one_ns]: [u32; 3], spike_ns: u32) -> Vec<String> {
    let mut board = Board::new(&image(), &[]);
    // Raw levels, high at first (`emulator/README.md`).
    let mut frame = vec![255, 1];
    for bit in (0..16).rev() {
        let high_ns = if 0x11_u16 >> bit & 1 != 0 {
            one_ns
        } else {
            zero_ns
        };
        let before_ns = (bit_ns - high_ns - spike_ns) / 2;
        let after_ns = bit_ns - high_ns - spike_ns - before_ns;
        let levels = if spike_ns > 0 {
            vec![high_ns, before_ns, spike_ns, after_ns]
        } else {
            vec![high_ns, bit_ns - high_ns]
        };
        frame.extend(levels.into_iter().flat_map(u32::to_le_bytes));
    }
    for _ in 0..800 {
        let now_ns = board.now_ns();
        board.board.wire(0).play(now_ns, &frame).expect("a frame");
        board.run(250 * US);
    }
    board.heard.texts()
}

/// Of a spike of 80 ns nothing is seen, such as each switching edge rings in beside the wire; the shortest level that
/// is DShot's is, and with a tenth to spare.
#[test]
fn a_spike_on_the_wire_is_no_edge_but_the_shortest_level_is() {
    let texts = found_out([1_667, 625, 1_250], 80);
    assert!(texts.contains(&"Throttle: DShot600".into()), "{texts:?}");
    let texts = found_out([833, 280, 560], 0);
    assert!(texts.contains(&"Throttle: DShot1200".into()), "{texts:?}");
}

/// The power-up tunes, a start, a stop that outlasts the drivers' supplies, and another start: all begin with
/// the low sides.
#[test]
fn the_high_sides_drivers_are_supplied_before_a_high_side_goes_on() {
    let mut board = Board::new(&image(), &[]);
    for _ in 0..2 {
        board.spin_up();
        board.throttle = Throttle::Dshot(0);
        let still = board.run_until(50 * MS, 5_000 * MS, |board| board.rpm() < 1.0);
        assert!(still.is_some(), "{} rpm", board.rpm());
    }
    assert!(board.world().bridge().edges() > 10_000);
    assert_eq!(board.world().bridge().starved(), 0);
}
