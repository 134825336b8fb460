//! A complete throttle input, driven by edges and by events.

mod noise;

use std::vec::Vec;

use super::authority::{Command, TestError};
use super::calibration::Step;
use super::demand::Reading;
use super::dshot::{Frame, Rate, edges};
use super::endpoints::EndPoints;
use super::signal::Pulse;
use super::*;
use crate::command::Beacon;

const TICK_HZ: u32 = 170_000_000;
const DSHOT600: Signal = Signal::Dshot {
    rate: Rate::Dshot600,
    bidirectional: false,
};
const RESTING: DriveStatus = DriveStatus {
    stopped: true,
    faulted: false,
};
const TURNING: DriveStatus = DriveStatus {
    stopped: false,
    faulted: false,
};

/// An input, its clock, and the news and orders it has given.
#[derive(Clone)]
struct Bench {
    input: Input,
    now_us: u64,
    drive: DriveStatus,
    began_us: u64,
    news: Vec<(u64, News)>,
    orders: Vec<Order>,
}

impl Bench {
    fn new(protocol: Option<Signal>) -> Self {
        let settings = Settings {
            protocol,
            timing: Timing {
                arm_us: 300_000,
                loss_us: 100_000,
            },
            reading: Reading::default(),
        };
        let began_us = 5_000_000;
        let mut bench = Self {
            input: Input::new(TICK_HZ, settings),
            now_us: began_us,
            drive: RESTING,
            began_us,
            news: Vec::new(),
            orders: Vec::new(),
        };
        bench.poll();
        bench
    }

    fn poll(&mut self) {
        self.input.poll(self.now_us, self.drive);
        while let Some(news) = self.input.news(self.now_us) {
            let at_ms = (self.now_us - self.began_us) / 1000;
            self.news.push((at_ms, news));
        }
    }

    fn ticks(&self, after_ns: u64) -> u32 {
        ((self.now_us * 1000 + after_ns) * u64::from(TICK_HZ) / 1_000_000_000) as u32
    }

    fn take(&mut self, heard: Option<Heard>) {
        self.orders.extend(heard.and_then(|heard| heard.order));
    }

    /// Advances time in 1 ms steps, with nothing on the wire.
    fn wait_ms(&mut self, ms: u64) {
        for _ in 0..ms {
            self.now_us += 1_000;
            let ticks = self.ticks(0);
            let heard = self.input.settle(self.now_us, ticks);
            self.take(heard);
            self.poll();
        }
    }

    /// DShot600 frames 1 ms apart, each cut off after its first edges; 32 is all of them.
    fn cut_frames(&mut self, count: u32, value: u16, edges_of_it: usize) {
        let frame = Frame {
            value,
            telemetry: false,
        };
        for _ in 0..count {
            for (at_ns, level) in edges(frame.to_bits(), Rate::Dshot600).take(edges_of_it) {
                let ticks = self.ticks(u64::from(at_ns));
                let heard = self.input.edge(self.now_us, ticks, level);
                self.take(heard);
            }
            let ticks = self.ticks(40_000);
            let heard = self.input.settle(self.now_us + 40, ticks);
            self.take(heard);
            self.wait_ms(1);
        }
    }

    fn frames(&mut self, count: u32, value: u16) {
        self.cut_frames(count, value, 32);
    }

    fn armed() -> Self {
        let mut bench = Self::new(None);
        bench.frames(400, 0);
        assert!(bench.input.authority().armed());
        bench.news.clear();
        bench.began_us = bench.now_us;
        bench
    }

    /// Servo pulses, 20 ms apart.
    fn pulses(&mut self, count: u32, width_us: u32) {
        for _ in 0..count {
            for (at_us, level) in [(0, true), (u64::from(width_us), false)] {
                let ticks = self.ticks(at_us * 1000);
                let heard = self.input.edge(self.now_us + at_us, ticks, level);
                self.take(heard);
            }
            self.wait_ms(20);
        }
    }

    fn turns(&self) -> bool {
        !self.input.authority().command().rests()
    }
}

#[test]
fn a_signal_is_identified_armed_and_lost_and_each_is_told() {
    let mut bench = Bench::new(None);
    bench.frames(500, 0);
    bench.wait_ms(500);
    let [(found_ms, found), (armed_ms, armed), (lost_ms, lost)] = bench.news[..] else {
        panic!("{:?}", bench.news);
    };
    assert_eq!(found, News::Identified(DSHOT600));
    assert!(found_ms <= 100, "{found_ms}");
    assert_eq!((armed_ms, armed), (301, News::Armed));
    assert_eq!((lost_ms, lost), (600, News::Lost { armed: true }));
}

#[test]
fn a_loss_that_nobody_had_armed_is_told_as_such() {
    let mut bench = Bench::new(None);
    bench.frames(200, 0);
    bench.wait_ms(200);
    let losses: Vec<_> = bench
        .news
        .iter()
        .filter(|(_, news)| matches!(news, News::Lost { .. }))
        .collect();
    assert_eq!(losses, [&(300, News::Lost { armed: false })]);
    assert_eq!(bench.input.signal(bench.now_us), None);
}

#[test]
fn a_wire_that_comes_and_goes_does_not_flood_the_link() {
    let mut bench = Bench::new(None);
    for _ in 0..50 {
        bench.frames(60, 0);
        bench.wait_ms(140);
    }
    // 10 s: each kind at most once a second.
    for kind in [News::Identified(DSHOT600), News::Lost { armed: false }] {
        let told = bench.news.iter().filter(|(_, news)| *news == kind).count();
        assert!((8..=10).contains(&told), "{kind:?}: {told}");
    }
}

#[test]
fn throttle_open_at_power_up_never_turns_and_says_so() {
    let mut bench = Bench::new(Some(DSHOT600));
    for _ in 0..10_000 {
        bench.frames(1, 300);
        assert!(!bench.turns() && !bench.input.authority().armed());
    }
    let told = bench
        .news
        .iter()
        .filter(|(_, news)| *news == News::OpenThrottle);
    let told_ms: Vec<_> = told.map(|(at_ms, _)| *at_ms).collect();
    assert_eq!(told_ms, [501, 3501, 6501, 9501]);
    // Lowered, it arms, and may open from then on.
    bench.news.clear();
    bench.frames(310, 0);
    bench.frames(10_000, 300);
    assert!(bench.turns());
    assert!(matches!(bench.news[..], [(_, News::Armed)]));
}

#[test]
fn a_signal_of_no_known_kind_is_told_while_it_lasts() {
    let mut bench = Bench::new(None);
    // Frames that break off in the middle, all of them.
    bench.cut_frames(8_000, 0, 21);
    let unknown = bench.news.iter().filter(|news| news.1 == News::Unknown);
    let at_ms: Vec<_> = unknown.map(|news| news.0 / 500).collect();
    assert_eq!(at_ms, [7, 13], "{:?}", bench.news);
    bench.news.clear();
    bench.frames(4_000, 0);
    assert!(!bench.news.iter().any(|news| news.1 == News::Unknown));
}

#[test]
fn a_throttle_that_is_lowered_in_time_is_not_complained_of() {
    let mut bench = Bench::new(Some(DSHOT600));
    for _ in 0..20 {
        bench.frames(499, 300);
        bench.frames(1, 0);
    }
    assert!(
        !bench
            .news
            .iter()
            .any(|(_, news)| *news == News::OpenThrottle)
    );
}

#[test]
fn ten_seconds_of_any_command_at_1_khz_reset_nothing_and_turn_nothing() {
    for value in 1..48 {
        let mut bench = Bench::new(None);
        for _ in 0..10_000 {
            bench.frames(1, value);
            assert!(!bench.turns());
        }
        assert!(bench.input.authority().armed(), "{value}");
        assert_eq!(bench.input.bad_frames(), 0);
        let means_something = matches!(value, 1..=10 | 12..=14 | 20..=22 | 26 | 31);
        assert_eq!(bench.orders.len(), usize::from(means_something), "{value}");
        // Its throttle is obeyed as usual.
        bench.frames(4, 1000);
        assert!(bench.turns());
    }
}

#[test]
fn commands_between_throttle_are_zero_throttle_and_not_obeyed() {
    let mut bench = Bench::armed();
    bench.drive = TURNING;
    for _ in 0..1_000 {
        bench.frames(4, 1000);
        assert!(bench.turns());
        bench.frames(9, 21);
        assert_eq!(bench.input.authority().command(), Command::Zero);
    }
    assert_eq!(bench.orders, []);
    assert!(bench.input.authority().armed());
    // Repeats that arrive after the motor has stopped count from then on.
    bench.drive = RESTING;
    bench.poll();
    bench.frames(5, 21);
    assert_eq!(bench.orders, []);
    bench.frames(1, 21);
    assert_eq!(bench.orders, [Order::Spin { opposite: true }]);
}

#[test]
fn some_commands_count_at_zero_throttle_while_the_motor_turns() {
    for value in 1..48 {
        let at_once = matches!(value, 13 | 14);
        let waits = matches!(value, 7 | 8 | 12 | 20 | 21);
        let mut bench = Bench::armed();
        bench.drive = TURNING;
        bench.frames(4, 1000);
        bench.frames(20, value);
        assert_eq!(bench.orders.len(), usize::from(at_once), "{value}");
        bench.frames(4, 1000);
        bench.orders.clear();
        bench.frames(101, 0);
        bench.frames(20, value);
        assert_eq!(bench.orders.len(), usize::from(at_once || waits), "{value}");
    }
}

#[test]
fn a_frame_that_breaks_off_does_not_end_a_row() {
    for cut in (2..32).step_by(2) {
        let mut bench = Bench::armed();
        bench.frames(5, 21);
        bench.cut_frames(1, 21, cut);
        assert_eq!(bench.orders, [], "{cut}");
        bench.frames(1, 21);
        assert_eq!(bench.orders, [Order::Spin { opposite: true }], "{cut}");
    }
}

#[test]
fn a_command_in_a_test_of_the_motor_is_not_obeyed() {
    let mut bench = Bench::armed();
    let now_us = bench.now_us;
    let tested = bench
        .input
        .authority_mut()
        .actuator_test(now_us, 0.1, 1.0, RESTING);
    assert_eq!(tested, Ok(()));
    bench.frames(20, 8);
    assert_eq!(bench.orders, []);
}

#[test]
fn single_frames_are_commands_on_a_clean_wire_only() {
    let mut bench = Bench::armed();
    bench.frames(1, 2);
    assert_eq!(bench.orders, [Order::Beacon(Beacon::Two)]);
    bench.frames(300, 0);
    bench.cut_frames(1, 0, 20);
    bench.frames(10, 0);
    bench.frames(1, 2);
    assert_eq!(bench.orders.len(), 1, "a bad frame was just before");
}

#[test]
fn a_line_that_sticks_or_is_cut_in_a_frame_stops_the_motor() {
    // The line is low after the frame's last edge, high after the one before.
    for cut in [0, 1, 2, 15, 16, 31] {
        let mut bench = Bench::armed();
        bench.frames(10, 1000);
        assert!(bench.turns());
        bench.cut_frames(1, 2047, cut);
        let Command::Throttle(throttle) = bench.input.authority().command() else {
            panic!("a millisecond is no loss");
        };
        assert!(throttle < 0.5, "{cut}: a part of a frame changes nothing");
        bench.wait_ms(98);
        assert!(bench.turns());
        bench.wait_ms(3);
        assert!(!bench.turns() && !bench.input.authority().armed(), "{cut}");
        // Longer than the ticks take to wrap.
        bench.wait_ms(60_000);
        assert!(!bench.turns());
        assert_eq!(bench.input.signal(bench.now_us), None);
        bench.frames(500, 0);
        assert!(bench.input.authority().armed(), "{cut}");
        assert!(bench.orders.is_empty());
    }
}

#[test]
fn the_frame_rate_may_change_in_flight() {
    let mut bench = Bench::armed();
    bench.frames(3, 1000);
    for gap_ms in [0, 1, 2, 20, 50, 90, 0, 90] {
        for _ in 0..20 {
            bench.frames(1, 1000);
            bench.wait_ms(gap_ms);
            assert!(bench.turns(), "{gap_ms}");
        }
    }
    assert_eq!(bench.news, []);
}

#[test]
fn the_stick_teaches_the_end_points_and_turns_nothing() {
    let mut bench = Bench::new(None);
    let mut steps = Vec::new();
    for (count, width_us) in [
        (190, 1912),
        (10, 1500),
        (100, 1105),
        (200, 1912),
        (80, 1105),
    ] {
        for _ in 0..count {
            bench.pulses(1, width_us);
            assert!(!bench.turns() && !bench.input.authority().armed());
        }
    }
    for (_, news) in &bench.news {
        if let News::Calibration(step) = news {
            steps.push(*step);
        }
    }
    let ends = EndPoints {
        min_us: 1105,
        max_us: 1912,
    };
    let wanted = [Step::Full, Step::Done(ends), Step::Again, Step::Identify];
    assert_eq!(steps, wanted);
}

#[test]
fn a_chip_that_was_reset_learns_nothing_from_the_stick() {
    let mut bench = Bench::new(None);
    bench.input.end_calibration();
    bench.pulses(300, 1912);
    bench.pulses(200, 1105);
    let learns = |news: &(u64, News)| matches!(news.1, News::Calibration(_));
    assert!(!bench.news.iter().any(learns), "{:?}", bench.news);
}

#[test]
fn a_stick_that_is_zero_by_the_old_ends_arms_nothing_while_it_teaches() {
    let mut bench = Bench::new(None);
    // Longer than arming takes, twice, and shorter than the calibration.
    for (count, width_us) in [(190, 1912), (40, 1000), (100, 1912), (40, 1000)] {
        for _ in 0..count {
            bench.pulses(1, width_us);
            assert!(!bench.turns() && !bench.input.authority().armed());
        }
    }
    let now_us = bench.now_us;
    let authority = bench.input.authority_mut();
    assert!(authority.arm(now_us).is_err());
    let tested = authority.actuator_test(now_us, 0.1, 1.0, RESTING);
    assert_eq!(tested, Err(TestError::TemporarilyRejected));
    bench.pulses(40, 1000);
    let (_, last) = bench.news.last().expect("it is told");
    let ends = EndPoints {
        min_us: 1000,
        max_us: 1912,
    };
    assert_eq!(*last, News::Calibration(Step::Done(ends)));
}

#[test]
fn frames_first_and_pulses_later_are_no_calibration() {
    let mut bench = Bench::new(None);
    bench.frames(200, 0);
    bench.wait_ms(300);
    bench.pulses(300, 1912);
    bench.pulses(100, 1105);
    let calibrated = bench
        .news
        .iter()
        .any(|(_, news)| matches!(news, News::Calibration(_)));
    assert!(!calibrated);
    assert_eq!(
        bench.input.signal(bench.now_us),
        Some(Signal::Pulse(Pulse::Servo))
    );
}

#[test]
fn another_protocol_must_be_armed_anew() {
    let mut bench = Bench::armed();
    bench.frames(4, 1000);
    let mut settings = bench.input.settings;
    bench.input.set(settings);
    assert!(bench.turns(), "nothing has changed");
    settings.protocol = Some(DSHOT600);
    bench.input.set(settings);
    assert!(!bench.turns());
    bench.frames(299, 0);
    assert!(!bench.input.authority().armed());
    bench.frames(2, 0);
    assert!(bench.input.authority().armed());
}
