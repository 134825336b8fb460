//! Arming, signal loss and tests, with exact counts and times.

use super::*;
use crate::dshot::{Frame, Rate};
use proptest::prelude::*;

mod motor_test;
mod opening;
mod signals;

const TIMING: Timing = Timing {
    arm_us: 300_000,
    loss_us: 100_000,
};
const RESTING: DriveStatus = DriveStatus {
    stopped: true,
    faulted: false,
};

const IDENTIFIED: Option<Signal> = Some(Signal::Dshot {
    rate: Rate::Dshot600,
    bidirectional: false,
});

fn event(value: u16) -> Event {
    Event::Frame {
        rate: Rate::Dshot600,
        bidirectional: false,
        first_edge_ticks: 0,
        frame_ticks: None,
        frame: Frame {
            value,
            telemetry: false,
        },
    }
}

/// An authority, its clock, and frames 1 ms apart unless stated otherwise.
struct Bench {
    authority: Authority,
    now_us: u64,
}

impl Bench {
    fn new() -> Self {
        Self {
            authority: Authority::new(TIMING),
            now_us: 5_000_000,
        }
    }

    fn armed() -> Self {
        let mut bench = Self::new();
        bench.play(301, event(0));
        assert!(bench.authority.armed());
        bench
    }

    /// Armed and opened to this throttle.
    fn open(value: u16) -> Self {
        let mut bench = Self::armed();
        bench.play(OPENING.into(), event(value));
        assert!(bench.turns());
        bench
    }

    fn after(&mut self, us: u64, event: Event) {
        self.now_us += us;
        self.authority.wire(self.now_us, event, IDENTIFIED);
    }

    fn play(&mut self, count: u32, event: Event) {
        for _ in 0..count {
            self.after(1_000, event);
        }
    }

    /// Waits without an event.
    fn wait(&mut self, us: u64) {
        self.now_us += us;
        self.authority.poll(self.now_us);
    }

    fn test(&mut self, value: f32, duration_s: f32) -> Result<(), TestError> {
        self.authority
            .actuator_test(self.now_us, value, duration_s, RESTING)
    }

    fn turns(&self) -> bool {
        matches!(
            self.authority.command(),
            Command::Throttle(_) | Command::Test(_)
        )
    }
}

#[test]
fn zero_throttle_arms_at_the_exact_time() {
    let mut bench = Bench::new();
    bench.play(1, event(0));
    bench.play(298, event(0));
    bench.after(1_999, event(0));
    assert!(!bench.authority.armed(), "299.999 ms");
    bench.after(1, event(0));
    assert!(bench.authority.armed(), "300 ms");
    assert!(!bench.turns());
    bench.play(4, event(2047));
    assert_eq!(bench.authority.command(), Command::Throttle(Share::MAX));
    bench.after(1_000, event(48));
    assert_eq!(bench.authority.command(), Command::Throttle(Share::ZERO));
    bench.after(1_000, event(47));
    assert_eq!(bench.authority.command(), Command::Zero);
    assert!(bench.authority.armed());
}

#[test]
fn slow_frames_arm_at_the_thirtieth() {
    let mut bench = Bench::new();
    for count in 1..=30 {
        assert!(!bench.authority.armed(), "{count}");
        bench.after(100_000, event(0));
    }
    assert!(bench.authority.armed());
}

#[test]
fn a_gap_above_the_loss_time_restarts_the_count() {
    let mut bench = Bench::new();
    bench.play(300, event(0));
    bench.after(100_001, event(0));
    assert!(!bench.authority.armed());
    bench.play(299, event(0));
    assert!(!bench.authority.armed());
    bench.play(1, event(0));
    assert!(bench.authority.armed());
}

#[test]
fn commands_count_as_zero() {
    for value in 1..=47 {
        let mut bench = Bench::new();
        bench.play(301, event(value));
        assert!(bench.authority.armed(), "{value}");
        bench.play(500, event(value));
        assert!(bench.authority.armed(), "{value}");
        assert!(!bench.turns());
    }
}

#[test]
fn throttle_open_at_power_up_never_turns() {
    let mut bench = Bench::new();
    for _ in 0..60_000 {
        bench.after(1_000, event(1000));
        assert!(!bench.turns() && !bench.authority.armed());
    }
}

#[test]
fn one_open_throttle_restarts_the_count() {
    let mut bench = Bench::new();
    bench.play(300, event(0));
    bench.after(1_000, event(48));
    bench.play(300, event(0));
    assert!(!bench.authority.armed());
    bench.play(1, event(0));
    assert!(bench.authority.armed());
}

#[test]
fn bad_frames_alone_neither_arm_nor_keep_a_signal() {
    let mut bench = Bench::new();
    bench.play(5_000, Event::Bad);
    assert!(!bench.authority.armed());
    assert!(!bench.authority.signal_present(bench.now_us));

    let mut bench = Bench::open(1000);
    bench.play(100, Event::Bad);
    assert!(bench.turns() && bench.authority.armed(), "100 ms");
    bench.play(1, Event::Bad);
    assert!(!bench.turns() && !bench.authority.armed(), "101 ms");
    bench.play(10, event(1000));
    assert!(!bench.turns());
}

#[test]
fn bad_frames_do_not_disturb_an_armed_wire() {
    for bad in 0..=3 {
        let mut bench = Bench::open(1000);
        for _ in 0..1_000 {
            bench.after(1_000, event(1000));
            bench.play(bad, Event::Bad);
            assert!(bench.turns(), "{bad}");
        }
    }
}

/// After at most 24 frames the bad ones outweigh the good ones, which then no longer count as a signal.
#[test]
fn a_wire_whose_frames_mostly_fail_is_lost() {
    for bad in [6, 9, 15] {
        let mut bench = Bench::open(1000);
        let mut lost_ms = None;
        for ms in 0..1_000 {
            if ms % (bad + 1) == bad {
                bench.after(1_000, event(2047));
            } else {
                bench.after(1_000, Event::Bad);
            }
            if !bench.authority.armed() {
                lost_ms.get_or_insert(ms);
            }
            assert!(!bench.turns() || lost_ms.is_none(), "{bad}");
        }
        let lost_ms = lost_ms.expect("it is lost");
        assert!((100..=125).contains(&lost_ms), "{bad}: {lost_ms} ms");
        // The link has recovered.
        bench.play(4, event(0));
        bench.play(301, event(0));
        assert!(bench.authority.armed());
    }
}

#[test]
fn a_stop_is_obeyed_on_a_wire_that_is_not_believed() {
    let mut bench = Bench::open(1000);
    let held = bench.authority.command();
    bench.play(50, Event::Bad);
    bench.after(1_000, event(2047));
    assert_eq!(bench.authority.command(), held, "no other throttle");
    bench.after(1_000, event(0));
    assert_eq!(bench.authority.command(), Command::Zero);
    bench.after(1_000, event(2047));
    assert_eq!(bench.authority.command(), Command::Zero);
    bench.play(3, event(2047));
    assert!(bench.turns(), "believed again");
}

#[test]
fn more_than_half_bad_restarts_the_count() {
    let mut bench = Bench::new();
    for _ in 0..1_000 {
        bench.play(1, event(0));
        bench.play(2, Event::Bad);
    }
    assert!(!bench.authority.armed());

    let mut bench = Bench::new();
    for _ in 0..151 {
        assert!(!bench.authority.armed());
        bench.play(1, event(0));
        bench.play(1, Event::Bad);
    }
    assert!(bench.authority.armed(), "half of them");
}

#[test]
fn a_lost_signal_stops_and_disarms() {
    for polled in [true, false] {
        let mut bench = Bench::open(1000);
        if polled {
            bench.wait(100_000);
            assert!(bench.turns());
            bench.wait(1);
            assert!(!bench.turns() && !bench.authority.armed());
        } else {
            bench.now_us += 100_001;
        }
        assert!(!bench.authority.signal_present(bench.now_us));
        // Throttle is still open when the signal returns.
        bench.play(1_000, event(1000));
        assert!(!bench.turns());
        bench.play(300, event(0));
        assert!(!bench.authority.armed());
        bench.play(1, event(0));
        bench.play(4, event(1000));
        assert!(bench.turns());
    }
}

#[test]
fn an_armed_wire_may_be_silent_behind_a_command() {
    for (value, most_us) in [(0, 100_000), (1, 300_000), (47, 300_000), (48, 100_000)] {
        let mut bench = Bench::armed();
        bench.play(10, event(value));
        bench.wait(most_us);
        assert!(bench.authority.armed(), "{value}");
        assert!(bench.authority.signal_present(bench.now_us), "{value}");
        bench.wait(1);
        assert!(!bench.authority.armed(), "{value}");
    }
    // A longer loss time is used as it is.
    let mut bench = Bench::armed();
    bench.authority.set_timing(Timing {
        loss_us: 500_000,
        ..TIMING
    });
    bench.play(1, event(1));
    bench.wait(500_000);
    assert!(bench.authority.armed());
    bench.wait(1);
    assert!(!bench.authority.armed());
    // An unarmed wire starts over.
    let mut bench = Bench::new();
    bench.play(300, event(1));
    bench.after(100_001, event(1));
    bench.play(299, event(1));
    assert!(!bench.authority.armed());
    bench.play(1, event(1));
    assert!(bench.authority.armed());
}

#[test]
fn a_frame_that_is_not_believed_ends_the_silence_behind_a_command() {
    for value in [0, 48, 1805] {
        let mut bench = Bench::armed();
        bench.after(1_000, event(1));
        bench.play(20, Event::Bad);
        bench.after(1_000, event(value));
        bench.wait(79_000);
        assert!(bench.authority.armed(), "{value}");
        bench.wait(1);
        assert!(
            !bench.authority.armed(),
            "{value}: 100 ms behind the command"
        );
        assert!(!bench.turns(), "{value}");
    }
}

#[test]
fn disarming_stops_until_zero_was_held_anew() {
    let mut bench = Bench::open(1000);
    bench.authority.disarm();
    assert!(!bench.turns());
    bench.play(1_000, event(1000));
    assert!(!bench.turns());
    bench.play(200, event(0));
    bench.authority.disarm();
    bench.play(300, event(0));
    assert!(!bench.authority.armed());
    bench.play(1, event(0));
    assert!(bench.authority.armed());
}

#[test]
fn a_request_to_arm_needs_valid_zero_and_does_not_replace_it() {
    let mut bench = Bench::new();
    assert_eq!(bench.authority.arm(bench.now_us), Err(Denied));
    bench.after(1_000, event(0));
    assert_eq!(bench.authority.arm(bench.now_us), Ok(()));
    assert!(!bench.authority.armed());
    bench.after(1_000, event(1000));
    assert_eq!(bench.authority.arm(bench.now_us), Err(Denied));
    assert!(!bench.turns());
    bench.after(1_000, event(0));
    assert_eq!(bench.authority.arm(bench.now_us + 100_000), Ok(()));
    assert_eq!(bench.authority.arm(bench.now_us + 100_001), Err(Denied));
}

#[test]
fn new_times_hold_at_once() {
    let mut bench = Bench::new();
    bench.play(40, event(0));
    bench.authority.set_timing(Timing {
        arm_us: 40_000,
        loss_us: 2_000,
    });
    bench.play(1, event(0));
    assert!(bench.authority.armed());
    bench.wait(2_001);
    assert!(!bench.authority.armed());
}

proptest! {
    /// In any sequence, the wire turns the motor only after 30 zero frames in 300 ms and until the signal is
    /// lost, and a test only for its time.
    #[test]
    fn nothing_else_turns_the_motor(
        steps in prop::collection::vec((0..12_u8, 0..40_000_u64, 0.0..3.0_f32), 1..400),
    ) {
        let mut bench = Bench::new();
        // A plain model: since when only zeros were valid, how many, and whether they have armed.
        let mut zero_since_us = None;
        let mut zeros = 0;
        let mut may_turn = false;
        let mut valid_us = 0;
        let mut test_until_us = 0;
        for (kind, us, number) in steps {
            bench.now_us += us;
            let now_us = bench.now_us;
            if now_us - valid_us > TIMING.loss_us {
                (zero_since_us, zeros, may_turn) = (None, 0, false);
            }
            match kind {
                0..=7 => {
                    bench.authority.wire(now_us, event(0), IDENTIFIED);
                    valid_us = now_us;
                    zeros += 1;
                    let since_us = *zero_since_us.get_or_insert(now_us);
                    may_turn |= zeros >= 30 && now_us - since_us >= TIMING.arm_us;
                }
                8 => {
                    bench.authority.wire(now_us, event(1000), IDENTIFIED);
                    valid_us = now_us;
                    (zero_since_us, zeros) = (None, 0);
                }
                9 => bench.authority.wire(now_us, Event::Bad, IDENTIFIED),
                10 => {
                    bench.authority.poll(now_us);
                    if bench.test(0.5, number).is_ok() {
                        test_until_us = now_us + (number * 1e6) as u64;
                    }
                }
                _ => {
                    bench.authority.poll(now_us);
                    if number < 0.3 {
                        bench.authority.disarm();
                        (zero_since_us, zeros, may_turn) = (None, 0, false);
                    }
                }
            }
            match bench.authority.command() {
                Command::Throttle(_) => prop_assert!(may_turn),
                Command::Test(_) => prop_assert!(now_us < test_until_us),
                Command::Stop | Command::Zero => {}
            }
        }
    }
}

#[test]
fn only_an_armed_zero_or_a_disarming_forgives_a_fault() {
    let mut bench = Bench::new();
    assert_eq!(bench.authority.command(), Command::Stop);
    bench.play(10, event(0));
    assert_eq!(bench.authority.command(), Command::Stop, "not armed yet");
    bench.play(300, event(0));
    assert_eq!(bench.authority.command(), Command::Zero);
    bench.wait(200_000);
    assert_eq!(bench.authority.command(), Command::Stop, "silent");
    bench.authority.fault(true);
    bench.authority.disarm();
    assert_eq!(bench.authority.command(), Command::Zero);
    bench.authority.fault(true);
    assert_eq!(bench.authority.command(), Command::Zero);
    bench.authority.fault(false);
    assert_eq!(bench.authority.command(), Command::Stop);
}
