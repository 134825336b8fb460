//! The self-test by command, on the emulated ESC: a sound one passes, each defect is named, the motor does
//! not turn, and it is done only under the rule of what may turn one.

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd, MavMessage, MavResult};
use mavlink::{MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message};
use siskin_control::drive::Setpoint;
use siskin_control::mavlink::Receiver;
use siskin_control::params::{ParamId, Params};
use siskin_emulator::device::{Device, Start};
use siskin_emulator::fault::{Fault, Kind, Side};
use siskin_emulator::link::LinkId;
use siskin_emulator::rig::{Period, Rig};

const MS_NS: u64 = 1_000_000;
/// 16 bits of DShot600: zero throttle, and half.
const ZERO: u16 = 0;
const HALF: u16 = 1048;

/// An ESC, and a ground station that hears it.
struct Station {
    device: Device,
    listener: Receiver,
    /// The results of the command, with the percentages.
    acks: Vec<(MavResult, u8)>,
    texts: Vec<String>,
    /// Greatest speed of the shaft, rpm, and greatest phase current, A.
    rpm: f64,
    current_a: f64,
    pulls: usize,
}

impl Station {
    fn new(kinds: &[Kind], params: &[(ParamId, f32)]) -> Self {
        let at_s = 0.2;
        let fault = |kind: &Kind| Fault {
            at_s,
            for_s: None,
            kind: *kind,
        };
        let start = Start {
            overrides: params.to_vec(),
            faults: kinds.iter().map(fault).collect(),
            link_bytes_per_s: 1_000_000,
            ..Start::default()
        };
        let (device, warning) = Device::start(start).expect("it starts");
        assert_eq!(warning, None);
        let mut station = Self {
            device,
            listener: Receiver::default(),
            acks: Vec::new(),
            texts: Vec::new(),
            rpm: 0.0,
            current_a: 0.0,
            pulls: 0,
        };
        station.run(1000, None);
        station.texts.clear();
        station.rpm = 0.0;
        station.current_a = 0.0;
        station
    }

    /// So many milliseconds, each with a frame of this throttle, if there is one.
    fn run(&mut self, count_ms: u64, throttle: Option<u16>) {
        for _ in 0..count_ms {
            let now_ns = self.device.now_ns();
            if let Some(throttle) = throttle {
                let data = throttle << 1;
                let bits = data << 4 | (data ^ data >> 4 ^ data >> 8) & 0xF;
                let [low, high] = bits.to_le_bytes();
                let wire = self.device.wire();
                wire.play(now_ns, &[12, low, high]).expect("there is room");
            }
            let Self {
                device,
                listener,
                acks,
                texts,
                rpm,
                current_a,
                pulls,
            } = self;
            let mut onlooker = |_: f64, period: &Period, _: &Rig| {
                *rpm = rpm.max(period.rpm().abs());
                for current in period.motion.currents_a {
                    *current_a = current_a.max(current.abs());
                }
                *pulls += usize::from(matches!(period.setpoint, Setpoint::Pull(_)));
            };
            let mut send = |frame: &[u8]| {
                listener.push(now_ns / 1000, frame, |frame| {
                    match MavMessage::parse(MavlinkVersion::V2, frame.id, frame.payload) {
                        Ok(MavMessage::COMMAND_ACK(_)) => {
                            let result = frame.payload[2];
                            let result = [
                                MavResult::MAV_RESULT_ACCEPTED,
                                MavResult::MAV_RESULT_TEMPORARILY_REJECTED,
                                MavResult::MAV_RESULT_FAILED,
                                MavResult::MAV_RESULT_IN_PROGRESS,
                            ]
                            .into_iter()
                            .find(|of| *of as u8 == result)
                            .expect("one of these");
                            // Trailing zeros are not sent.
                            acks.push((result, frame.payload.get(3).copied().unwrap_or(0)));
                        }
                        Ok(MavMessage::STATUSTEXT(text)) => {
                            texts.push(text.text.to_str().expect("ASCII").to_owned());
                        }
                        _ => {}
                    }
                });
            };
            device.advance(now_ns + MS_NS, |_, _| None, &mut onlooker, &mut send);
        }
    }

    fn ask(&mut self) {
        let mut raw = MAVLinkV2MessageRaw::new();
        let header = MavHeader {
            system_id: 255,
            component_id: 190,
            sequence: 0,
        };
        raw.serialize_message_data(
            header,
            &COMMAND_LONG_DATA {
                command: MavCmd::MAV_CMD_RUN_PREARM_CHECKS,
                target_system: 1,
                target_component: 1,
                ..COMMAND_LONG_DATA::default()
            },
        );
        let mut nobody = |_: f64, _: &Period, _: &Rig| {};
        self.device
            .receive(LinkId::default(), raw.raw_bytes(), &mut nobody);
    }

    /// The whole of one: how it ends.
    fn check(&mut self) -> MavResult {
        self.ask();
        self.run(1500, None);
        let (result, _) = *self.acks.last().expect("it is acknowledged");
        result
    }

    /// What is out of bounds, by the text that tells of it.
    fn named(&self) -> Vec<&str> {
        let told = self
            .texts
            .iter()
            .find_map(|text| text.strip_prefix("Self-test: "));
        told.map_or(Vec::new(), |names| names.split(", ").collect())
    }
}

#[test]
fn a_sound_esc_passes_and_its_motor_does_not_turn() {
    for changes in [
        &[][..],
        &[(ParamId::MotStop, 0.0)],
        &[(ParamId::CtlDrive, 1.0), (ParamId::CtlRpmMax, 4500.0)],
        &[(ParamId::CtlRpmMax, 2000.0), (ParamId::PwmFreqHz, 8_000.0)],
        &[(ParamId::PwmFreqHz, 48_000.0)],
        &[(ParamId::MotDir, 1.0)],
        &[(ParamId::LimPhaseA, 5.0)],
    ] {
        let mut station = Station::new(&[], changes);
        assert_eq!(
            station.check(),
            MavResult::MAV_RESULT_ACCEPTED,
            "{changes:?}"
        );
        assert!(station.texts.is_empty(), "{:?}", station.texts);
        let going = &station.acks[..station.acks.len() - 1];
        assert!(
            going
                .iter()
                .all(|(result, _)| *result == MavResult::MAV_RESULT_IN_PROGRESS)
        );
        let percents: Vec<_> = going.iter().map(|(_, percent)| *percent).collect();
        assert_eq!(percents, [255, 30, 40, 50, 60, 70, 80, 90]);
        // A fifth of LIM_PHASE_A, and what a period or two of delay add.
        let limit = Params::default().get(ParamId::LimPhaseA);
        assert!(
            station.current_a < 0.35 * f64::from(limit),
            "{}",
            station.current_a
        );
        assert!(station.rpm < 30.0, "{} rpm", station.rpm);
        // Again, once it is done.
        assert_eq!(station.check(), MavResult::MAV_RESULT_ACCEPTED);
    }
}

#[test]
fn each_defect_is_named() {
    for (phase, letter) in ["a", "b", "c"].into_iter().enumerate() {
        let own = |kind: &str| format!("{kind}_{letter}");
        for (kind, item) in [
            (Kind::MosfetOpen(phase, Side::High), own("high")),
            (Kind::MosfetOpen(phase, Side::Low), own("low")),
            (Kind::MosfetShort(phase, Side::High), own("rest")),
            (Kind::PhaseOpen(phase), own("motor")),
            (Kind::SensorStuck(phase, 0.0), own("noise")),
            (Kind::SensorStuck(phase, 30.0), own("zero")),
            (Kind::OffsetDrift(phase, 6.0), own("zero")),
            (Kind::OffsetDrift(phase, -6.0), own("zero")),
        ] {
            // The tunes would find an offset before.
            let mut station = Station::new(&[kind], &[(ParamId::MotToneA, 0.0)]);
            assert_eq!(station.check(), MavResult::MAV_RESULT_FAILED, "{kind:?}");
            let named = station.named();
            assert!(named.contains(&item.as_str()), "{kind:?}: {named:?}");
            assert!(station.rpm < 60.0, "{kind:?}: {} rpm", station.rpm);
        }
    }
    let mut station = Station::new(&[Kind::Noise(1.0)], &[]);
    assert_eq!(station.check(), MavResult::MAV_RESULT_FAILED);
    assert_eq!(station.named()[..3], ["noise_a", "noise_b", "noise_c"]);
}

/// The others are pulled up with rising duty: the current of a test shows it before one that trips. The
/// first leg to be pulled has none before it, and shoots through as a start would.
#[test]
fn a_shorted_low_side_is_named_by_a_small_current() {
    for phase in 0..3 {
        let short = Kind::MosfetShort(phase, Side::Low);
        let mut station = Station::new(&[short], &[(ParamId::MotToneA, 0.0)]);
        assert_eq!(station.check(), MavResult::MAV_RESULT_FAILED);
        let item = ["high_a", "off_b", "off_c"][phase];
        assert!(station.named().contains(&item), "{:?}", station.named());
        let tripped = station
            .texts
            .iter()
            .any(|text| text == "Fault: over-current");
        assert_eq!(tripped, phase == 0, "{:?}", station.texts);
        if phase > 0 {
            assert!(station.current_a < 7.0, "{} A", station.current_a);
        }
    }
}

#[test]
fn it_is_done_at_rest_alone_and_ends_with_any_throttle() {
    // At zero throttle, as without a wire.
    let mut station = Station::new(&[], &[]);
    station.run(500, Some(ZERO));
    station.ask();
    station.run(1500, Some(ZERO));
    assert_eq!(
        station.acks.last().expect("one").0,
        MavResult::MAV_RESULT_ACCEPTED
    );

    // The throttle takes the motor over within the time of the frame that opens it.
    station.acks.clear();
    station.ask();
    station.run(150, Some(ZERO));
    assert_eq!(
        station.acks.last().expect("one").0,
        MavResult::MAV_RESULT_IN_PROGRESS
    );
    station.run(3, Some(HALF));
    station.pulls = 0;
    station.run(5, Some(HALF));
    assert!(station.pulls < 30, "{}", station.pulls);
    assert_eq!(
        station.acks.last().expect("one").0,
        MavResult::MAV_RESULT_FAILED
    );
    station.run(2000, Some(HALF));
    assert!(station.rpm > 3000.0, "{}", station.rpm);

    // And while it turns, or coasts, there is none.
    station.acks.clear();
    station.pulls = 0;
    station.ask();
    station.run(50, Some(HALF));
    let rejected = MavResult::MAV_RESULT_TEMPORARILY_REJECTED;
    assert_eq!(station.acks, [(rejected, 0)]);
    assert_eq!(station.pulls, 0);
}
