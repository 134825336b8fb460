//! An ESC with its edges, polls and requests: what DShot commands and the stick do.

use std::string::{String, ToString};
use std::vec::Vec;

use siskin_params::{BOSSO_MOTOR, Image};
use siskin_throttle::access::Access;
use siskin_throttle::answer::Ask;
use siskin_throttle::command::Beacon;
use siskin_throttle::dshot::{self, Rate, edges};
use siskin_throttle::signal::Signal;

use super::*;
use crate::answer::Answer;
use crate::drive::{Direction, Fault, Faults, Setpoint, State};
use crate::tune::{Note, Player};
use mavlink::dialects::ardupilotmega::{
    COMMAND_ACK_DATA, MavMessage, MavResult, PARAM_VALUE_DATA, STATUSTEXT_DATA,
};
use mavlink::{MavlinkVersion, Message, MessageData};

mod actions;
mod check;
#[cfg(feature = "drift")]
mod drift;
mod fit;
mod keep;
mod storage;
mod warnings;

const TICK_HZ: u32 = 170_000_000;

/// An ESC, its clock, its drive's snapshot, and everything it has sent and requested.
struct Bench {
    esc: Esc,
    throttle: Throttle,
    snapshot: Snapshot,
    now_us: u64,
    texts: Vec<String>,
    /// Index and value of each PARAM_VALUE.
    values: Vec<(u16, f32)>,
    /// Results of MAVLink commands.
    results: Vec<MavResult>,
    requests: Vec<Request>,
    answers: Vec<Answer>,
    /// The notes of the last polls, without repeats.
    notes: Vec<Note>,
}

impl Bench {
    /// Creates one whose board has finished its power-up test, as far as one without comparators can.
    fn new() -> Self {
        let mut bench = Self::at_power_up();
        for _ in 0..3 {
            bench.esc.test_itself(&bench.snapshot, &mut check::Plain);
        }
        // There is no supply, which it has reported.
        bench.poll();
        bench.texts.clear();
        bench
    }

    fn at_power_up() -> Self {
        Self::with(Params::of(&BOSSO_MOTOR))
    }

    /// Powers one up with these parameters, fitting or not.
    fn with(params: Params) -> Self {
        let (esc, throttle) = Esc::power_up(params, Board::BENCH, TICK_HZ, 1_000_000);
        let config = esc.config().expect("the defaults fit");
        let mut bench = Self {
            snapshot: State::new(&config).snapshot(),
            esc,
            throttle,
            now_us: 1_000_000,
            texts: Vec::new(),
            values: Vec::new(),
            results: Vec::new(),
            requests: Vec::new(),
            answers: Vec::new(),
            notes: Vec::new(),
        };
        bench.poll();
        bench
    }

    /// Armed by DShot600, at rest long enough for storage, with its tunes over.
    fn armed() -> Self {
        let mut bench = Self::new();
        bench.frames(1_100, 0);
        assert!(bench.esc.telemetry().armed);
        bench.texts.clear();
        bench.notes.clear();
        bench
    }

    fn poll(&mut self) {
        let (texts, values) = (&mut self.texts, &mut self.values);
        let results = &mut self.results;
        let throttle = &mut self.throttle;
        self.esc
            .poll(throttle, self.now_us, &self.snapshot, 25.0, &mut |frame| {
                let mut id = [0; 4];
                id[..3].copy_from_slice(&frame[7..10]);
                let payload = &frame[10..][..usize::from(frame[1])];
                let id = u32::from_le_bytes(id);
                if ![
                    STATUSTEXT_DATA::ID,
                    PARAM_VALUE_DATA::ID,
                    COMMAND_ACK_DATA::ID,
                ]
                .contains(&id)
                {
                    return;
                }
                match MavMessage::parse(MavlinkVersion::V2, id, payload).expect("a whole message") {
                    MavMessage::STATUSTEXT(text) => {
                        texts.push(text.text.to_str().expect("ASCII").to_string());
                    }
                    MavMessage::PARAM_VALUE(value) => {
                        values.push((value.param_index, value.param_value));
                    }
                    MavMessage::COMMAND_ACK(ack) => results.push(ack.result),
                    other => panic!("{other:?}"),
                }
            });
        while let Some(request) = self.esc.take_request(&mut self.throttle) {
            self.requests.push(request);
        }
        if let Some(note) = self.esc.tunes.note()
            && self.notes.last() != Some(&note)
        {
            self.notes.push(note);
        }
    }

    fn wait_ms(&mut self, ms: u32) {
        for _ in 0..ms {
            self.now_us += 1_000;
            let ticks = self.ticks(0);
            self.throttle.settle(self.now_us, ticks);
            self.poll();
        }
    }

    fn ticks(&self, after_ns: u64) -> u32 {
        ((self.now_us * 1000 + after_ns) * u64::from(TICK_HZ) / 1_000_000_000) as u32
    }

    /// DShot600 frames, 1 ms apart.
    fn frames(&mut self, count: u32, value: u16) {
        let frame = dshot::Frame {
            value,
            telemetry: true,
        };
        for _ in 0..count {
            for (at_ns, level) in edges(frame.to_bits(), Rate::Dshot600) {
                let ticks = self.ticks(u64::from(at_ns));
                let ask = self.throttle.edge(self.now_us, ticks, level);
                self.answer(ask);
            }
            let ticks = self.ticks(40_000);
            let ask = self.throttle.settle(self.now_us, ticks);
            self.answer(ask);
            self.wait_ms(1);
        }
    }

    fn answer(&mut self, ask: Option<Ask>) {
        if let Some(ask) = ask {
            self.answers.push(self.throttle.answer(ask, &self.snapshot));
        }
    }

    /// Servo pulses, 20 ms apart.
    fn pulses(&mut self, count: u32, width_us: u32) {
        for _ in 0..count {
            for (at_us, level) in [(0, true), (u64::from(width_us), false)] {
                let ticks = self.ticks(at_us * 1000);
                self.throttle.edge(self.now_us + at_us, ticks, level);
            }
            self.wait_ms(20);
        }
    }

    fn config(&self) -> Config {
        self.esc.config().expect("what is in force can be built")
    }

    fn get(&self, id: ParamId) -> f32 {
        self.esc.params().get(id)
    }

    fn storage_done(&mut self, result: Result<(), &'static str>) {
        self.esc.storage_done(&mut self.throttle, result);
        self.wait_ms(1);
    }
}

#[test]
fn direction_and_3d_are_parameters_that_are_told_and_put_in_force() {
    let mut bench = Bench::armed();
    for (command, id, value) in [
        (8, ParamId::MotDir, 1.0),
        (7, ParamId::MotDir, 0.0),
        (10, ParamId::Inp3d, 1.0),
        (9, ParamId::Inp3d, 0.0),
    ] {
        bench.frames(5, command);
        assert_ne!(bench.get(id), value, "{command}: five");
        bench.frames(5, command);
        assert_eq!(bench.get(id), value, "{command}");
        assert_eq!(bench.values, [(id as u16, value)]);
        assert_eq!(bench.requests, [Request::ParamsChanged]);
        let reversed = bench.config().direction == Direction::Reversed;
        assert_eq!(reversed, bench.get(ParamId::MotDir) == 1.0);
        bench.values.clear();
        bench.requests.clear();
    }
}

#[test]
fn a_wire_whose_3d_has_changed_is_armed_anew_and_turns_both_ways() {
    let mut bench = Bench::armed();
    bench.frames(10, 10);
    assert!(!bench.esc.telemetry().armed);
    bench.frames(310, 0);
    bench.frames(4, 1047);
    assert!(matches!(bench.throttle.setpoint(), Setpoint::Speed(speed) if speed.is_negative()));
    bench.frames(1, 2047);
    assert!(matches!(bench.throttle.setpoint(), Setpoint::Speed(speed) if speed.is_positive()));
}

#[test]
fn a_save_is_asked_for_once_and_its_end_is_told() {
    for (result, text) in [
        (Ok(()), "Parameters stored"),
        (Err("storage: worn out"), "storage: worn out"),
    ] {
        let mut bench = Bench::armed();
        bench.frames(10, 12);
        bench.wait_ms(35);
        assert_eq!(bench.requests, [Request::Save]);
        bench.storage_done(result);
        assert_eq!(bench.texts, [text]);
        bench.requests.clear();
        bench.frames(10, 12);
        assert_eq!(bench.requests, [], "the same run");
        bench.frames(1, 0);
        bench.frames(10, 12);
        assert_eq!(bench.requests, [Request::Save]);
    }
}

#[test]
fn a_spin_against_the_direction_is_no_parameter() {
    let mut bench = Bench::armed();
    bench.frames(10, 21);
    assert_eq!(bench.config().direction, Direction::Reversed);
    assert_eq!(bench.get(ParamId::MotDir), 0.0);
    assert_eq!(bench.values, []);
    assert_eq!(bench.requests, [Request::ParamsChanged]);
    // It turns against MOT_DIR, whatever that is.
    bench.frames(10, 8);
    assert_eq!(bench.config().direction, Direction::Normal);
    bench.frames(10, 20);
    assert_eq!(bench.config().direction, Direction::Reversed);
    assert!(bench.esc.telemetry().armed);
}

#[test]
fn a_turning_motor_obeys_no_command() {
    let mut bench = Bench::armed();
    bench.snapshot.phase = Phase::Run;
    bench.wait_ms(1);
    for command in 1..48 {
        bench.frames(10, command);
    }
    assert_eq!(bench.esc.params(), &Params::of(&BOSSO_MOTOR));
    assert_eq!(bench.requests, []);
    assert!(!bench.esc.light());
    assert!(bench.answers.iter().all(|answer| answer.info.is_none()));
    assert_eq!(bench.notes, []);
}

/// Directions wait for a motor at rest, the latest of each kind, followed by the save.
#[test]
fn what_waits_is_done_once_when_the_motor_stands() {
    let mut bench = Bench::armed();
    bench.snapshot.phase = Phase::Run;
    bench.wait_ms(1);
    for command in [8, 7, 8, 12, 21] {
        bench.frames(10, command);
    }
    bench.frames(1_000, 0);
    assert_eq!(bench.requests, []);
    bench.snapshot.phase = Phase::Idle;
    bench.frames(2, 0);
    assert_eq!(bench.get(ParamId::MotDir), 1.0);
    assert_eq!(
        bench.config().direction,
        Direction::Normal,
        "against MOT_DIR"
    );
    assert_eq!(bench.values, [(ParamId::MotDir as u16, 1.0)], "once");
    assert!(
        bench.requests.contains(&Request::Save),
        "{:?}",
        bench.requests
    );
    bench.requests.clear();
    bench.frames(1_000, 0);
    assert_eq!(bench.requests, []);
}

#[test]
fn what_waits_is_forgotten_at_throttle_at_a_test_and_with_the_signal() {
    for end in 0..3 {
        let mut bench = Bench::armed();
        bench.snapshot.phase = Phase::Run;
        bench.wait_ms(1);
        bench.frames(10, 8);
        match end {
            0 => bench.frames(4, 1000),
            1 => {
                let drive = DriveStatus {
                    stopped: true,
                    faulted: false,
                };
                let mut authority = LockedAuthority(&mut bench.throttle);
                let tested = authority.actuator_test(bench.now_us, 0.1, 0.005, drive);
                assert_eq!(tested, Ok(()));
                bench.frames(1, 0);
            }
            _ => bench.wait_ms(310),
        }
        bench.snapshot.phase = Phase::Idle;
        bench.frames(400, 0);
        assert_eq!(bench.get(ParamId::MotDir), 0.0, "{end}");
    }
}

#[test]
fn information_is_sent_with_the_answer_to_its_frame() {
    let mut bench = Bench::armed();
    bench.answers.clear();
    bench.frames(10, 6);
    let sent: Vec<_> = bench.answers.iter().map(|answer| answer.info).collect();
    assert_eq!(
        sent[0],
        Some(info(bench.esc.params(), false, &Image::EMULATOR))
    );
    assert!(sent[1..].iter().all(Option::is_none));
}

#[test]
fn the_light_is_on_and_off_by_command() {
    let mut bench = Bench::armed();
    for (command, on) in [(22, true), (26, false), (23, false), (22, true), (29, true)] {
        bench.frames(2, command);
        assert_eq!(bench.esc.light(), on, "{command}");
    }
}

#[test]
fn events_are_heard_as_tunes_and_in_silent_mode_beacons_alone() {
    let first = |tune| {
        let mut player = Player::default();
        player.play(0, tune);
        player.note(0).expect("it begins with one")
    };
    let mut bench = Bench::new();
    bench.frames(200, 0);
    assert!(bench.notes.contains(&first(Tune::Start)));
    bench.frames(400, 0);
    assert!(bench.notes.contains(&first(Tune::Armed)));

    bench.notes.clear();
    bench.frames(1, 3);
    bench.frames(299, 0);
    assert_eq!(bench.notes[0], first(Tune::Beacon(Beacon::Three)));
    bench.notes.clear();
    bench.wait_ms(700);
    let told = bench.texts.last().map(String::as_str);
    assert_eq!(told, Some("Throttle: signal lost while armed"));
    assert_eq!(bench.notes[0], first(Tune::Lost));

    bench.notes.clear();
    bench.frames(100, 0);
    bench.frames(10, 31);
    bench.frames(490, 0);
    assert!(bench.esc.telemetry().armed);
    assert_eq!(bench.notes, [], "silent");
    bench.frames(1, 1);
    bench.frames(299, 0);
    assert_eq!(bench.notes[0], first(Tune::Beacon(Beacon::One)));
    bench.notes.clear();
    bench.frames(10, 31);
    bench.wait_ms(700);
    assert_eq!(bench.notes[0], first(Tune::Lost), "not any more");
}

#[test]
fn each_beacon_has_its_command() {
    let beacons = [
        Beacon::One,
        Beacon::Two,
        Beacon::Three,
        Beacon::Four,
        Beacon::Five,
    ];
    for (command, beacon) in (1..).zip(beacons) {
        let mut bench = Bench::armed();
        bench.frames(1, command);
        let mut player = Player::default();
        player.play(0, Tune::Beacon(beacon));
        assert_eq!(bench.notes.first().copied(), player.note(0));
    }
}

#[test]
fn the_stick_calibrates_and_the_ends_are_stored() {
    let mut bench = Bench::new();
    bench.pulses(180, 1912);
    let full = "Stick calibration: full taken, now lower it";
    assert_eq!(bench.texts.last().map(String::as_str), Some(full));
    assert_eq!(bench.esc.params(), &Params::of(&BOSSO_MOTOR));
    bench.notes.clear();
    bench.pulses(10, 1400);
    bench.pulses(78, 1105);
    assert_eq!(bench.get(ParamId::InpPulseMaxUs), 1912.0);
    assert_eq!(bench.get(ParamId::InpPulseMinUs), 1105.0);
    assert_eq!(bench.requests, [Request::ParamsChanged]);
    let done = "Stick calibration: both ends taken";
    assert_eq!(bench.texts.last().map(String::as_str), Some(done));
    let mut values = bench.values.clone();
    values.sort_by_key(|(index, _)| *index);
    let wanted = [
        (ParamId::InpPulseMinUs as u16, 1105.0),
        (ParamId::InpPulseMaxUs as u16, 1912.0),
    ];
    assert_eq!(values, wanted);
    // The new ends apply: what is zero throttle by them arms, once the stick may no longer ask for more, and
    // their middle is half throttle.
    bench.pulses(90, 1105);
    assert!(!bench.esc.telemetry().armed);
    bench.pulses(40, 1105);
    assert!(bench.esc.telemetry().armed);
    // They are stored when the tunes are over.
    assert_eq!(bench.requests, [Request::ParamsChanged, Request::Save]);
    bench.storage_done(Ok(()));
    assert_eq!(
        bench.texts.last().map(String::as_str),
        Some("Parameters stored")
    );
    bench.pulses(4, 1912);
    let Setpoint::Speed(speed) = bench.throttle.setpoint() else {
        panic!("it turns");
    };
    assert!((bench.config().scale.rpm(speed) - 6000.0).abs() < 1.0);
}

#[test]
fn telemetry_names_the_signal_while_it_is_there() {
    let mut bench = Bench::new();
    bench.frames(200, 0);
    let dshot600 = Signal::from_number(12);
    assert_eq!(bench.esc.telemetry().signal, dshot600);
    assert_eq!(
        bench.texts.last().map(String::as_str),
        Some("Throttle: DShot600")
    );
    bench.wait_ms(100);
    assert_eq!(bench.esc.telemetry().signal, None);
}
