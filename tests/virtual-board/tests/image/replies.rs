//! A [flight controller's decoder](crate::flight_controller) reads the reply to each frame: at DShot300, 600
//! and 1200, with frames as close as allowed and with gaps, while the motor turns and the parameter list is
//! being sent. Run with `--release`.

use mavlink::dialects::ardupilotmega::{PARAM_REQUEST_LIST_DATA, PARAM_VALUE_DATA};
use siskin_params::ParamId;

use crate::common::{
    BIDIRECTIONAL_300, BIDIRECTIONAL_600, BIDIRECTIONAL_1200, Board, MS, Scope, Throttle, image,
};
use crate::flight_controller::{DELAY_NS, Exchange, FlightController, Told};

const FRAMES: usize = 10_000;

/// The throttle.
const VALUE: u16 = 1000;

/// Largest gap added between frames.
const GAP_NS: f64 = 400_000.0;

/// Largest deviation of the control's speed estimate from the plant's.
const SPEED_ERROR: f64 = 0.002;

/// DShot command that turns extended telemetry on.
const EXTENDED_ON: u16 = 13;

/// What a window of frames has shown.
#[derive(Debug, Default)]
struct Seen {
    missing: usize,
    garbled: usize,
    wrong: usize,
    extended: [usize; 16],
    after_ns: Option<(f64, f64)>,
    worst_speed: f64,
}

impl Seen {
    fn take(&mut self, exchange: &Exchange, scope: &Scope, pole_pairs: f64) {
        let (Some(at_ns), Some(after_ns)) = (exchange.at_ns, exchange.after_ns) else {
            self.missing += 1;
            return;
        };
        let (least, most) = self.after_ns.unwrap_or((after_ns, after_ns));
        self.after_ns = Some((least.min(after_ns), most.max(after_ns)));
        let Some(word) = exchange.word() else {
            self.garbled += 1;
            return;
        };
        let passed = scope.motor.partition_point(|(at, _)| *at <= at_ns);
        let (_, motion) = scope.motor[passed - 1];
        let right = match Told::of(word) {
            Told::Stopped => false,
            Told::Turn { period_us, step_us } => {
                let turn_us = 1e6 * std::f64::consts::TAU / (motion.speed_rad_s * pole_pairs);
                let off_us = (f64::from(period_us) - turn_us).abs() - f64::from(step_us) / 2.0;
                self.worst_speed = self.worst_speed.max(off_us / turn_us);
                off_us < SPEED_ERROR * turn_us
            }
            Told::Extended { kind, value } => {
                self.extended[usize::from(kind)] += 1;
                let value = f64::from(value);
                match kind {
                    // Room temperature; volts in quarters; amperes, whose mean leaves out the ripple; no
                    // stress; nothing to report.
                    0x2 => (15.0..40.0).contains(&value),
                    0x4 => (value / 4.0 - motion.bus_v).abs() < 0.5,
                    0x6 => value <= 3.0,
                    0xc | 0xe => value == 0.0,
                    _ => false,
                }
            }
        };
        self.wrong += usize::from(!right);
    }
}

/// How many of the [`FRAMES`] may stay without a reply: a tenth of a percent. At DShot1200 there are 43 µs from a
/// frame's first edge to its reply, of which the task takes 26 and the PWM interrupt up to 11: if other interrupts
/// coincide with these, the reply would begin too late, and is left out. The flight controller then continues with the
/// speed from the previous frame.
const LATE: usize = FRAMES / 1000;

/// Asserts that every reply is read; `close_ns` is the closest frame interval for which this must hold.
fn every_reply_is_read(protocol: u8, bit_hz: f64, close_ns: f64) {
    let controller = FlightController { bit_hz };
    let mut board = Board::new(&image(), &[]);
    let pole_pairs = f64::from(board.world().bench().bench().motor.pole_pairs);
    board.protocol = protocol;
    board.throttle = Throttle::Dshot(0);
    board.run(400 * MS);
    board.throttle = Throttle::Dshot(EXTENDED_ON);
    board.run(10 * MS);
    board.spin_up();
    board.run(1_000 * MS);
    let gap_ns = |frame: usize| close_ns + GAP_NS * (frame as f64 * 0.569_840).fract();
    let (target_system, target_component) = (board.heard.from.system, board.heard.from.component);
    for apart_ns in [&|_| close_ns, &gap_ns as &dyn Fn(usize) -> f64] {
        board.heard.frames.clear();
        board.send(&PARAM_REQUEST_LIST_DATA {
            target_system,
            target_component,
        });
        let exchanges = controller.fly(&mut board, VALUE, FRAMES, apart_ns);
        let scope = board.heard.scope.take().expect("it was begun");
        let mut seen = Seen::default();
        for exchange in &exchanges {
            seen.take(exchange, &scope, pole_pairs);
        }
        let values = board.heard.messages::<PARAM_VALUE_DATA>().len();
        println!("{bit_hz} bit/s, {close_ns:.0} ns: {seen:?}, {values} parameters meanwhile");
        assert_eq!((seen.garbled, seen.wrong), (0, 0));
        assert!(seen.missing <= LATE, "{} of {FRAMES}", seen.missing);
        let (least_ns, most_ns) = seen.after_ns.expect("replies");
        assert!(least_ns > DELAY_NS - 2_000.0 && most_ns < DELAY_NS + 2_000.0);
        // Some 16 per second.
        assert!(seen.extended.iter().sum::<usize>() > 5);
        assert!(values > 20, "{values}");
    }
    assert_eq!(board.world().bridge().violations(), 0);
}

// If Betaflight wants replies, it sends at most every 200 µs at DShot300 and every 100 µs at DShot600. A frame,
// the delay and the reply take 139, 85 and 57 µs.

#[test]
fn every_reply_is_read_at_dshot300() {
    every_reply_is_read(BIDIRECTIONAL_300, 300e3, 160_000.0);
}

#[test]
fn every_reply_is_read_at_dshot600() {
    every_reply_is_read(BIDIRECTIONAL_600, 600e3, 100_000.0);
}

#[test]
fn every_reply_is_read_at_dshot1200() {
    every_reply_is_read(BIDIRECTIONAL_1200, 1.2e6, 90_000.0);
}

/// A flight controller that sends before the ESC starts: it is heard from somewhere within its first frame.
#[test]
fn who_sends_while_the_esc_starts_is_answered() {
    for protocol in [BIDIRECTIONAL_300, BIDIRECTIONAL_600, BIDIRECTIONAL_1200] {
        for from_us in (0..500).step_by(50) {
            let mut board = Board::new(&image(), &[]);
            board.protocol = protocol;
            board.run(from_us * 1_000);
            board.throttle = Throttle::Dshot(0);
            board.run(100 * MS);
            let (played, replies) = (board.played, board.heard.replies.len());
            board.run(100 * MS);
            let unanswered = (board.played - played).abs_diff(board.heard.replies.len() - replies);
            // One may be under way at either end.
            assert!(
                unanswered <= 1,
                "{protocol}, from {from_us} us: {unanswered}"
            );
        }
    }
}

/// Nothing is known of the motor, as delivered: six-step, whose interrupts are longer.
const UNKNOWN: [(ParamId, f32); 5] = [
    (ParamId::MotRMohm, 0.0),
    (ParamId::MotLUh, 0.0),
    (ParamId::MotFluxMwb, 0.0),
    (ParamId::MotJGcm2, 0.0),
    (ParamId::CtlMode, 2.0),
];

/// In six-step at most one reply in a thousand is left out, at each rate and each of these throttles.
#[test]
fn every_reply_comes_as_delivered() {
    const FRAMES: usize = 3_000;
    for (protocol, bit_hz) in [
        (BIDIRECTIONAL_300, 300e3),
        (BIDIRECTIONAL_600, 600e3),
        (BIDIRECTIONAL_1200, 1.2e6),
    ] {
        let mut board = Board::new(&image(), &UNKNOWN);
        board.protocol = protocol;
        board.throttle = Throttle::Dshot(0);
        board.run(400 * MS);
        board.throttle = Throttle::Dshot(VALUE);
        let turns = board.run_until(50 * MS, 6_000 * MS, |board| board.rpm() > 500.0);
        assert!(turns.is_some(), "{:?}", board.heard.texts());
        board.run(500 * MS);
        let gap_ns = |frame: usize| 950_000.0 + 100_000.0 * (frame as f64 * 0.569_840).fract();
        let exchanges = FlightController { bit_hz }.fly(&mut board, VALUE, FRAMES, gap_ns);
        let heard = exchanges
            .iter()
            .filter(|exchange| exchange.word().is_some());
        let missing = FRAMES - heard.count();
        println!(
            "{bit_hz} bit/s, {:.0} rpm: {missing} of {FRAMES} are missing",
            board.rpm()
        );
        assert!(missing <= FRAMES / 1_000, "{bit_hz}: {missing}");
    }
}
