//! What turns the bridge off by itself, and what a ground station hears of it: the tasks' side and the
//! drive on its bench, at a temperature set by the test.

use mavlink::dialects::ardupilotmega::{
    COMMAND_LONG_DATA, EscFailureFlags, MavCmd, MavMessage, MavParamType, MavResult, PARAM_SET_DATA,
};
use mavlink::types::CharArray;
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message};
use siskin_control::drive::{Bridge, Fault, Phase, Setpoint};
use siskin_control::esc::Esc;
use siskin_control::mavlink::{Frame, Receiver, Request};
use siskin_control::throttle::Throttle;
use siskin_emulator::device::Latest;
use siskin_emulator::plant::Fidelity;
use siskin_emulator::rig::{Bench, Rig};
use siskin_emulator::wire::Wire;
use siskin_params::{BOSSO_BENCH, ParamId, Params};

const CAPTURE_HZ: u32 = 170_000_000;
const MS_NS: u64 = 1_000_000;
const STOP: u16 = 0;
/// Maps to 3150 rpm.
const HALF: u16 = 1048;
/// Maps to 6000 rpm.
const FULL: u16 = 2047;
const ROOM_C: f32 = 25.0;

/// An ESC on its bench, with a flight controller that sends a frame every millisecond.
struct Station {
    esc: Esc,
    throttle: Throttle,
    rig: Rig,
    wire: Wire,
    receiver: Receiver,
    /// Reads what the ESC sends.
    listener: Receiver,
    heard: Vec<MavMessage>,
    temperature_c: f32,
    now_ns: u64,
    periods: u64,
}

/// How a stretch of time ended.
#[derive(Debug)]
struct Seen {
    rpm: f64,
    /// Whether the bridge was on in any period.
    on: bool,
}

impl Station {
    fn new(params: Params) -> Self {
        Self::on(Bench::default(), params)
    }

    fn on(bench: Bench, params: Params) -> Self {
        let board = bench.sensing.board(bench.delay);
        let (esc, throttle) =
            Esc::new(params, board, CAPTURE_HZ, 1_000_000).expect("the parameters fit the bench");
        let config = esc.config().expect("they fit");
        let rig = Rig::new(bench, config);
        Self {
            esc,
            throttle,
            rig,
            wire: Wire::detached(),
            receiver: Receiver::default(),
            listener: Receiver::default(),
            heard: Vec::new(),
            temperature_c: ROOM_C,
            now_ns: 0,
            periods: 0,
        }
    }

    /// Creates one that has turned at half throttle for 3 s.
    fn turning() -> Self {
        let mut station = Self::new(Params::of(&BOSSO_BENCH));
        station.run(400, STOP);
        let seen = station.run(3_000, HALF);
        assert!((seen.rpm - 3150.0).abs() < 31.5, "{seen:?}");
        station
    }

    /// Runs for `count_ms`, with a frame of this throttle at the start of each millisecond.
    fn run(&mut self, count_ms: u64, throttle: u16) -> Seen {
        let mut seen = Seen {
            rpm: 0.0,
            on: false,
        };
        for _ in 0..count_ms {
            let data = throttle << 1;
            let bits = data << 4 | (data ^ data >> 4 ^ data >> 8) & 0xF;
            let [low, high] = bits.to_le_bytes();
            self.wire
                .play(self.now_ns, &[12, low, high])
                .expect("a frame fits in a millisecond");
            self.now_ns += MS_NS;
            while let Some((edge_ns, level)) = self.wire.next_edge(self.now_ns) {
                let ticks = u128::from(edge_ns) * u128::from(CAPTURE_HZ) / 1_000_000_000;
                self.throttle.edge(edge_ns / 1000, ticks as u32, level);
            }
            let setpoint = self.throttle.setpoint();
            let period_ns = self.rig.period_s() * 1e9;
            while (self.periods as f64 * period_ns) < self.now_ns as f64 {
                let period = self.rig.period(setpoint);
                self.periods += 1;
                seen.on |= period.bridge != Bridge::Off;
                seen.rpm = period.rpm();
            }
            self.tasks();
        }
        seen
    }

    fn tasks(&mut self) {
        let now_us = self.now_ns / 1000;
        let (listener, heard) = (&mut self.listener, &mut self.heard);
        self.esc.poll(
            &mut self.throttle,
            now_us,
            &self.rig.snapshot(),
            self.temperature_c,
            &mut |frame| {
                listener.push(now_us, frame, |frame| heard.push(message(frame)));
            },
        );
        self.esc
            .test_itself(&self.rig.snapshot(), &mut Latest::at_rest());
        while let Some(request) = self.esc.take_request(&mut self.throttle) {
            if request == Request::Keep {
                self.esc.storage_done(&mut self.throttle, Ok(()));
                continue;
            }
            assert_eq!(request, Request::ParamsChanged);
            let config = self.esc.config().expect("what is in force fits");
            self.rig.configure(config);
        }
    }

    /// Sends the ESC a ground station's message.
    fn receive(&mut self, message: &MavMessage) {
        let header = MavHeader {
            system_id: 255,
            component_id: 190,
            sequence: 0,
        };
        let mut raw = MAVLinkV2MessageRaw::new();
        raw.serialize_message(header, message);
        let now_us = self.now_ns / 1000;
        let Self {
            receiver,
            esc,
            throttle,
            ..
        } = self;
        receiver.push(now_us, raw.raw_bytes(), |frame| {
            esc.receive(throttle, now_us, frame);
        });
    }

    fn set(&mut self, id: ParamId, value: f32) {
        let mut name = [0; 16];
        let text = id.entry().name.as_bytes();
        name[..text.len()].copy_from_slice(text);
        self.receive(&MavMessage::PARAM_SET(PARAM_SET_DATA {
            param_value: value,
            target_system: 1,
            target_component: 1,
            param_id: CharArray::new(name),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        }));
        self.tasks();
        assert_eq!(self.esc.params().get(id), value);
    }

    /// Requests a motor test, and returns the result.
    fn test(&mut self) -> MavResult {
        self.receive(&MavMessage::COMMAND_LONG(COMMAND_LONG_DATA {
            param1: 0.5,
            param2: 1.0,
            param3: 0.0,
            param4: 0.0,
            param5: 1.0,
            param6: 0.0,
            param7: 0.0,
            command: MavCmd::MAV_CMD_ACTUATOR_TEST,
            target_system: 1,
            target_component: 1,
            confirmation: 0,
        }));
        self.heard.clear();
        self.tasks();
        self.heard
            .iter()
            .find_map(|message| match message {
                MavMessage::COMMAND_ACK(ack) => Some(ack.result),
                _ => None,
            })
            .expect("each command is answered")
    }

    fn has(&self, fault: Fault) -> bool {
        self.esc.telemetry().faults.contains(fault)
    }

    fn texts(&self) -> Vec<&str> {
        let texts = self.heard.iter().filter_map(|message| match message {
            MavMessage::STATUSTEXT(text) => Some(text.text.to_str().expect("ASCII")),
            _ => None,
        });
        texts.collect()
    }

    /// Returns the failures in the last ESC_INFO.
    fn flags(&self) -> EscFailureFlags {
        let mut infos = self.heard.iter().rev();
        infos
            .find_map(|message| match message {
                MavMessage::ESC_INFO(info) => Some(info.failure_flags[0]),
                _ => None,
            })
            .map(EscFailureFlags::from_bits_retain)
            .expect("one a second")
    }
}

fn message(frame: &Frame) -> MavMessage {
    MavMessage::parse(MavlinkVersion::V2, frame.id, frame.payload)
        .expect("a message of the dialect")
}

#[test]
fn above_lim_temp_c_the_bridge_is_off_until_5_degrees_below_it_and_zero_throttle() {
    let mut station = Station::turning();
    station.temperature_c = 100.0;
    let at_limit = station.run(100, HALF);
    assert!((at_limit.rpm - 3150.0).abs() < 31.5, "{at_limit:?}");

    station.temperature_c = 100.1;
    station.heard.clear();
    station.run(2, HALF);
    assert_eq!(
        station.throttle.setpoint(),
        Setpoint::Fault(Fault::OverTemperature)
    );
    let hot = station.run(1_100, HALF);
    assert!(!hot.on, "{hot:?}");
    assert!(station.has(Fault::OverTemperature));
    assert_eq!(station.texts(), ["Fault: over-temperature"]);
    assert!(
        station
            .flags()
            .contains(EscFailureFlags::ESC_FAILURE_OVER_TEMPERATURE)
    );

    // Within the hysteresis zero throttle does not clear it; below it, an open throttle does not.
    station.temperature_c = 95.1;
    assert!(!station.run(1_000, STOP).on);
    assert!(station.has(Fault::OverTemperature));
    station.temperature_c = 94.9;
    assert!(!station.run(1_000, HALF).on);
    assert!(station.has(Fault::OverTemperature));

    station.run(1_500, STOP);
    assert!(!station.has(Fault::OverTemperature));
    assert_eq!(
        station.texts(),
        ["Fault: over-temperature", "Fault ended: over-temperature"]
    );
    assert!(station.flags().is_empty());
    let again = station.run(3_000, HALF);
    assert!((again.rpm - 3150.0).abs() < 31.5, "{again:?}");
}

#[test]
fn a_limit_that_is_lowered_in_flight_stops_no_motor() {
    for drive in [0.0, 1.0] {
        let mut params = Params::of(&BOSSO_BENCH);
        for (id, value) in [(ParamId::CtlDrive, drive), (ParamId::PwmFreqHz, 40_000.0)] {
            params.set(id, value).expect("in range");
        }
        let mut station = Station::on(
            Bench {
                plant: Fidelity::Switching,
                ..Bench::default()
            },
            params,
        );
        station.run(400, STOP);
        let fast = station.run(2_000, FULL);
        assert!((fast.rpm - 6000.0).abs() < 60.0, "{drive}: {fast:?}");
        let limit_a = |station: &Station| station.esc.phase_limit_a(&station.rig.snapshot());
        for lowered_a in [5.0, 2.0] {
            let before_a = limit_a(&station);
            station.set(ParamId::LimPhaseA, lowered_a);
            // Nor does the board's own trip drop below a current that still flows.
            assert!(limit_a(&station) > 0.99 * before_a, "{drive}, {lowered_a}");
            let slower = station.run(1_000, FULL);
            assert!(
                station.rig.snapshot().fault_count == 0,
                "{drive}, {lowered_a}: {:?}",
                station.texts()
            );
            assert!(slower.rpm > 1000.0, "{drive}, {lowered_a}: {slower:?}");
            let now_a = limit_a(&station);
            assert!((now_a - lowered_a).abs() < 0.05, "{drive}: {now_a}");
        }
        station.set(ParamId::LimPhaseA, 20.0);
        assert_eq!(limit_a(&station), 20.0);
        let fast = station.run(2_000, FULL);
        assert!((fast.rpm - 6000.0).abs() < 60.0, "{drive}: {fast:?}");
        assert_eq!(station.rig.snapshot().fault_count, 0, "{drive}");
    }
}

#[test]
fn a_motor_is_not_tested_while_its_shaft_turns_after_a_fault() {
    let mut station = Station::turning();
    station.temperature_c = 101.0;
    station.run(10, HALF);
    assert!(station.has(Fault::OverTemperature));
    station.temperature_c = ROOM_C;
    assert_eq!(station.test(), MavResult::MAV_RESULT_TEMPORARILY_REJECTED);

    let cleared = station.run(500, STOP);
    assert!(!station.has(Fault::OverTemperature));
    assert!(cleared.rpm > 500.0, "it coasts: {cleared:?}");
    let mut refused = 0;
    loop {
        let seen = station.run(50, STOP);
        if station.test() == MavResult::MAV_RESULT_ACCEPTED {
            // Only a shaft at rest may start.
            assert!(seen.rpm.abs() < 100.0, "{seen:?}");
            break;
        }
        refused += 1;
        assert!(refused < 400, "after 20 s a test is possible again");
    }
    assert!(refused > 10, "{refused}");
}

/// At a third of the true resistance or less, the winding's voltage drop at low speed is taken for
/// back-EMF, and the shaft is believed to turn.
const THIRD_AND_LESS_MOHM: [f32; 3] = [18.0, 27.0, 36.0];

#[test]
fn a_rotor_that_the_published_observer_has_lost_is_a_fault() {
    for resistance_mohm in THIRD_AND_LESS_MOHM {
        let mut params = Params::of(&BOSSO_BENCH);
        for (id, value) in [
            (ParamId::CtlObserver, 0.0),
            (ParamId::LimPolicy, 0.0),
            (ParamId::MotRMohm, resistance_mohm),
        ] {
            params.set(id, value).expect("in range");
        }
        let mut station = Station::new(params);
        station.run(400, STOP);
        for _ in 0..50 {
            if !station.has(Fault::ObserverLost) {
                station.run(100, HALF);
            }
        }
        assert!(station.has(Fault::ObserverLost), "{resistance_mohm} mOhm");
        let after = station.run(500, HALF);
        assert!(!after.on, "{resistance_mohm} mOhm: {after:?}");
        assert!(station.texts().contains(&"Fault: rotor position lost"));
    }
}

#[test]
fn the_default_observer_keeps_that_rotor() {
    for resistance_mohm in THIRD_AND_LESS_MOHM {
        let mut params = Params::of(&BOSSO_BENCH);
        params
            .set(ParamId::MotRMohm, resistance_mohm)
            .expect("in range");
        let mut station = Station::new(params);
        station.run(400, STOP);
        let seen = station.run(3_000, HALF);
        assert!(
            (seen.rpm - 3150.0).abs() < 31.5,
            "{resistance_mohm} mOhm: {seen:?}"
        );
        let faults = station.texts().into_iter().filter(|t| t.contains("Fault"));
        assert_eq!(faults.count(), 0, "{resistance_mohm} mOhm");
    }
}

const FAILED: &str = "Start failed: retrying";

#[test]
fn a_blocked_rotor_is_tried_a_few_times_and_then_stuck() {
    let mut station = Station::on(
        Bench {
            imposed_rad_s: Some(0.0),
            ..Bench::default()
        },
        Params::of(&BOSSO_BENCH),
    );
    station.run(400, STOP);
    let mut starts = 0;
    let mut before = Phase::Idle;
    for ms in 0..6_000 {
        station.run(1, HALF);
        let phase = station.rig.snapshot().phase;
        starts += u32::from(phase == Phase::Park && before != Phase::Park);
        before = phase;
        assert!(ms < 1_500 || station.texts().contains(&FAILED), "{ms} ms");
        if station.has(Fault::Stuck) {
            break;
        }
    }
    assert!(station.has(Fault::Stuck), "after {starts} starts");
    assert!((2..=5).contains(&starts), "{starts} starts");
    // Each failed start but the last, which is the fault.
    let failed = station.texts().into_iter().filter(|text| *text == FAILED);
    assert_eq!(failed.count(), starts as usize - 1);
    assert!(!station.run(1_100, HALF).on);
    assert!(station.texts().contains(&"Fault: motor does not start"));
    let stuck = EscFailureFlags::ESC_FAILURE_MOTOR_STUCK;
    assert!(station.flags().contains(stuck));
    station.run(1_500, STOP);
    assert!(!station.has(Fault::Stuck));
}

/// An offset beyond a tenth of the sensors' 40 A is a defect; a smaller one is measured and subtracted.
#[test]
fn a_current_sensor_whose_zero_is_far_off_is_a_fault_before_the_bridge_is_on() {
    let started = |offset_a: f64| {
        let mut bench = Bench::default();
        bench.sensing.offset_a[1] = offset_a;
        let mut station = Station::on(bench, Params::of(&BOSSO_BENCH));
        station.run(400, STOP);
        let seen = station.run(2_000, HALF);
        (station, seen)
    };
    for offset_a in [-6.0, 6.0] {
        let (station, seen) = started(offset_a);
        assert!(station.has(Fault::CurrentSensor), "{offset_a} A: {seen:?}");
        assert!(!seen.on, "{offset_a} A");
        assert!(station.texts().contains(&"Fault: current sensor defect"));
    }
    for offset_a in [-3.0, 3.0] {
        let (station, seen) = started(offset_a);
        assert!(!station.has(Fault::CurrentSensor), "{offset_a} A: {seen:?}");
        assert!((seen.rpm - 3150.0).abs() < 31.5, "{offset_a} A: {seen:?}");
    }
}

/// The interrupt tells the control of periods that took too long.
#[test]
fn a_flight_goes_on_after_control_periods_that_took_too_long() {
    let mut station = Station::turning();
    station.heard.clear();
    let tripped = station.rig.period(Setpoint::Fault(Fault::Overrun));
    station.periods += 1;
    assert_eq!(tripped.bridge, Bridge::Off);
    let pause = station.run(15, HALF);
    assert!(!pause.on && station.has(Fault::Overrun), "{pause:?}");
    let after = station.run(2_000, HALF);
    assert!((after.rpm - 3150.0).abs() < 31.5, "{after:?}");
    let told = ["Fault: control too slow", "Fault ended: control too slow"];
    assert_eq!(station.texts(), told);
}

/// With the bridge off, the open terminals tell the speed, and the throttle catches the turning shaft.
#[test]
fn a_coasting_shaft_is_reported_and_caught() {
    let mut station = Station::turning();
    station.temperature_c = 101.0;
    station.run(100, HALF);
    assert!(station.has(Fault::OverTemperature));
    station.temperature_c = ROOM_C;
    for _ in 0..40 {
        let seen = station.run(10, STOP);
        let snapshot = station.rig.snapshot();
        let reported = f64::from(station.rig.config().scale.rpm(snapshot.speed));
        assert!(
            (reported / seen.rpm - 1.0).abs() < 0.02,
            "{reported} {seen:?}"
        );
    }
    assert!(!station.has(Fault::OverTemperature));
    let coasting = station.run(10, STOP);
    assert!(!coasting.on && coasting.rpm > 1_000.0, "{coasting:?}");
    let mut least_rpm = f64::INFINITY;
    for _ in 0..1_000 {
        let seen = station.run(1, HALF);
        least_rpm = least_rpm.min(seen.rpm);
        assert_ne!(station.rig.snapshot().phase, Phase::Park);
    }
    assert!(least_rpm > 0.95 * coasting.rpm, "{least_rpm} {coasting:?}");
    let held = station.run(100, HALF);
    assert!((held.rpm - 3150.0).abs() < 31.5, "{held:?}");
}
