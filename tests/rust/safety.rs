//! What may turn the motor and what must stop it, from datagrams on the throttle wire to the simulated
//! motor's torque, to the millisecond of simulated time and with default parameters.

use siskin_control::drive::{Bridge, Setpoint};
use siskin_emulator::device::{Device, Start};
use siskin_emulator::fault::{Fault, Kind, Side};
use siskin_emulator::rig::{Period, Rig};
use siskin_params::{BOSSO_BENCH, ParamId};

const MS_NS: u64 = 1_000_000;

const DSHOT600: u8 = 12;
const STOP: u16 = 0;
/// The step above the middle of 48..2047, mapped to 300..6000 rpm.
const HALF: u16 = 1048;
const HALF_RPM: f64 = 3150.0;

/// Largest mean torque over 10 ms that counts as none, Nm: 2 % of what half throttle takes, for currents
/// that are regulated to zero through the converter's noise.
const NO_TORQUE_NM: f64 = 0.0015;
const TORQUE_OVER_MS: u64 = 10;

/// An ESC on its bench, with a flight controller that sends a frame every millisecond.
struct Flight {
    device: Device,
}

/// What was seen over some time.
#[derive(Clone, Copy, Debug)]
struct Seen {
    least_rpm: f64,
    most_rpm: f64,
    /// Mean over 10 ms.
    most_torque_nm: f64,
    /// Whether the bridge drove the motor in any period, other than for a tone.
    driven: bool,
}

impl Flight {
    fn new(overrides: &[(ParamId, f32)]) -> Self {
        let (device, warning) = Device::start(Start {
            overrides: [BOSSO_BENCH.settings, overrides].concat(),
            ..Start::default()
        })
        .expect("default parameters fit the bench");
        assert_eq!(warning, None);
        Self { device }
    }

    /// Creates an armed one, just after the frame that armed it.
    fn armed(overrides: &[(ParamId, f32)]) -> Self {
        let mut flight = Self::new(overrides);
        flight.send(400, frame(DSHOT600, STOP));
        assert!(flight.is_armed());
        flight
    }

    /// Creates one that has turned at half throttle for 3 s.
    fn turning(overrides: &[(ParamId, f32)]) -> Self {
        let mut flight = Self::armed(overrides);
        flight.send(3_000, frame(DSHOT600, HALF));
        flight
    }

    fn is_armed(&self) -> bool {
        self.device.esc().telemetry().armed
    }

    /// Sends a datagram at the start of each of `count_ms` milliseconds.
    fn send(&mut self, count_ms: u64, datagram: [u8; 3]) -> Seen {
        self.run(count_ms, |_| Some(datagram))
    }

    /// Leaves the wire silent for `count_ms`.
    fn silence(&mut self, count_ms: u64) -> Seen {
        self.run(count_ms, |_| None)
    }

    fn run(&mut self, count_ms: u64, datagram: impl Fn(u64) -> Option<[u8; 3]>) -> Seen {
        let mut seen = Seen {
            least_rpm: f64::INFINITY,
            most_rpm: f64::NEG_INFINITY,
            most_torque_nm: f64::NEG_INFINITY,
            driven: false,
        };
        let start_ns = self.device.now_ns();
        let (mut torques_nm, mut periods) = (0.0, 0);
        for ms in 0..count_ms {
            let now_ns = start_ns + ms * MS_NS;
            if let Some(datagram) = datagram(ms) {
                self.device
                    .wire()
                    .play(now_ns, &datagram)
                    .expect("a frame fits in a millisecond");
            }
            self.device.advance(
                now_ns + MS_NS,
                |_, _| None,
                &mut |_: f64, period: &Period, _: &Rig| {
                    seen.least_rpm = seen.least_rpm.min(period.rpm());
                    seen.most_rpm = seen.most_rpm.max(period.rpm());
                    torques_nm += period.motion.flow.torque_nm;
                    periods += 1;
                    let heard = matches!(period.setpoint, Setpoint::Tone(_));
                    seen.driven |= matches!(period.bridge, Bridge::Duty(_)) && !heard;
                },
                &mut |_| {},
            );
            if ms % TORQUE_OVER_MS == TORQUE_OVER_MS - 1 {
                seen.most_torque_nm = seen.most_torque_nm.max(torques_nm / f64::from(periods));
                (torques_nm, periods) = (0.0, 0);
            }
        }
        seen
    }
}

/// Returns a datagram with a frame of this value.
fn frame(protocol: u8, value: u16) -> [u8; 3] {
    let data = value << 1;
    let sum = (data ^ data >> 4 ^ data >> 8) & 0xF;
    let [low, high] = (data << 4 | sum).to_le_bytes();
    [protocol, low, high]
}

/// Returns the same with its checksum changed by `flip`, 1 to 15.
fn bad_frame(value: u16, flip: u8) -> [u8; 3] {
    let [protocol, low, high] = frame(DSHOT600, value);
    [protocol, low ^ flip, high]
}

#[test]
fn zero_throttle_arms_after_its_time_and_not_before() {
    let mut flight = Flight::new(&[]);
    // The board's power-up test comes first: three polls, a millisecond apart.
    flight.silence(5);
    flight.send(300, frame(DSHOT600, STOP));
    assert!(!flight.is_armed());
    // The first frame ends 27 µs after its start, and telemetry is read every millisecond.
    flight.send(2, frame(DSHOT600, STOP));
    assert!(flight.is_armed());
}

#[test]
fn half_throttle_is_reached_and_held_at_each_rate() {
    for protocol in [10, 11, DSHOT600] {
        let mut flight = Flight::new(&[]);
        flight.send(400, frame(protocol, STOP));
        flight.send(1_500, frame(protocol, HALF));
        let reached = flight.send(1, frame(protocol, HALF));
        assert!(
            (reached.most_rpm - HALF_RPM).abs() < 0.01 * HALF_RPM,
            "{protocol}: {reached:?}"
        );
        flight.send(1_000, frame(protocol, HALF));
        let held = flight.send(1_000, frame(protocol, HALF));
        assert!(
            held.least_rpm > 0.995 * HALF_RPM && held.most_rpm < 1.005 * HALF_RPM,
            "{protocol}: {held:?}"
        );
    }
}

#[test]
fn a_throttle_before_its_time_does_not_turn_the_motor_and_starts_the_count_again() {
    let mut flight = Flight::new(&[]);
    flight.send(290, frame(DSHOT600, STOP));
    let early = flight.send(500, frame(DSHOT600, HALF));
    assert!(!early.driven, "{early:?}");
    flight.send(290, frame(DSHOT600, STOP));
    assert!(!flight.is_armed());
    let again = flight.send(500, frame(DSHOT600, HALF));
    assert!(!again.driven, "{again:?}");
}

#[test]
fn a_throttle_that_is_open_at_power_up_does_not_turn_the_motor() {
    let mut flight = Flight::new(&[]);
    let seen = flight.send(2_000, frame(DSHOT600, HALF));
    assert!(!seen.driven && seen.most_rpm < 0.1, "{seen:?}");
    assert!(!flight.is_armed());
}

#[test]
fn at_zero_throttle_no_driving_torque_remains_and_the_shaft_stops() {
    let mut flight = Flight::turning(&[]);
    // One frame, one task period and one control period later.
    flight.send(3, frame(DSHOT600, STOP));
    let braking = flight.send(1_997, frame(DSHOT600, STOP));
    assert!(braking.most_torque_nm < NO_TORQUE_NM, "{braking:?}");
    let after = flight.send(500, frame(DSHOT600, STOP));
    assert!(
        after.most_rpm < 100.0 && after.least_rpm > -100.0,
        "{after:?}"
    );
}

#[test]
fn after_the_last_frame_no_driving_torque_remains_and_the_shaft_stops() {
    let mut flight = Flight::turning(&[]);
    let within = flight.silence(99);
    assert!(
        within.least_rpm > 0.995 * HALF_RPM,
        "not lost yet: {within:?}"
    );
    flight.silence(100 + 20 - 99);
    let braking = flight.silence(2_000);
    assert!(braking.most_torque_nm < NO_TORQUE_NM, "{braking:?}");
    assert!(!flight.is_armed());
    let after = flight.silence(500);
    assert!(
        after.most_rpm < 100.0 && after.least_rpm > -100.0,
        "{after:?}"
    );
    // It must be armed again.
    let back = flight.send(1_000, frame(DSHOT600, HALF));
    assert!(!back.driven, "{back:?}");
}

#[test]
fn with_mot_stop_0_no_torque_remains_and_the_propeller_slows_the_shaft() {
    let mut flight = Flight::turning(&[(ParamId::MotStop, 0.0)]);
    flight.send(3, frame(DSHOT600, STOP));
    let coasting = flight.send(500, frame(DSHOT600, STOP));
    assert!(coasting.most_torque_nm < NO_TORQUE_NM, "{coasting:?}");
    assert!(coasting.least_rpm > 100.0, "no brake: {coasting:?}");
}

#[test]
fn bad_check_sums_alone_neither_arm_nor_turn() {
    for value in [STOP, HALF] {
        let mut flight = Flight::new(&[]);
        let seen = flight.run(2_000, |ms| Some(bad_frame(value, (ms % 15) as u8 + 1)));
        assert!(!flight.is_armed());
        assert!(!seen.driven, "{value}: {seen:?}");
        assert_eq!(flight.device.esc().telemetry().bad_frames, 2_000);
    }
}

#[test]
fn bad_check_sums_are_no_signal() {
    let mut flight = Flight::turning(&[]);
    flight.send(120, bad_frame(HALF, 5));
    let braking = flight.send(1_000, bad_frame(HALF, 5));
    assert!(braking.most_torque_nm < NO_TORQUE_NM, "{braking:?}");
    assert!(!flight.is_armed());
}

#[test]
fn a_share_of_bad_check_sums_does_not_disturb_a_flight() {
    let mut flight = Flight::turning(&[]);
    let seen = flight.run(2_000, |ms| {
        Some(if ms % 3 == 0 {
            bad_frame(2047, 9)
        } else {
            frame(DSHOT600, HALF)
        })
    });
    assert!(
        seen.least_rpm > 0.995 * HALF_RPM && seen.most_rpm < 1.005 * HALF_RPM,
        "{seen:?}"
    );
}

#[test]
fn it_turns_again_from_any_speed_while_braking() {
    for stop_ms in [10, 100, 300, 600, 1_500] {
        let mut flight = Flight::turning(&[]);
        flight.send(stop_ms, frame(DSHOT600, STOP));
        flight.send(3_000, frame(DSHOT600, HALF));
        let seen = flight.send(200, frame(DSHOT600, HALF));
        assert!(
            seen.least_rpm > 0.99 * HALF_RPM && seen.most_rpm < 1.01 * HALF_RPM,
            "{stop_ms} ms of brake: {seen:?}"
        );
    }
}

#[test]
fn a_short_is_tried_three_times_in_flight_and_then_held() {
    for (policy, attempts) in [(0.0, 1), (1.0, 4)] {
        let mut flight = Flight::turning(&[(ParamId::LimPolicy, policy)]);
        let short = Fault {
            at_s: flight.device.now_ns() as f64 * 1e-9,
            for_s: None,
            kind: Kind::MosfetShort(1, Side::High),
        };
        flight.device.inject(short);
        flight.send(1_000, frame(DSHOT600, HALF));
        let trips = |flight: &Flight| flight.device.esc().telemetry().fault_count;
        assert_eq!(trips(&flight), attempts, "{policy}");
        let held = flight.send(2_000, frame(DSHOT600, HALF));
        assert!(!held.driven, "{policy}: {held:?}");
        assert_eq!(trips(&flight), attempts, "{policy}");
        // Once mended, it flies again only after zero throttle.
        flight.device.mend();
        let waiting = flight.send(500, frame(DSHOT600, HALF));
        assert!(!waiting.driven, "{policy}: {waiting:?}");
        flight.send(500, frame(DSHOT600, STOP));
        flight.send(3_000, frame(DSHOT600, HALF));
        let again = flight.send(100, frame(DSHOT600, HALF));
        assert!(again.least_rpm > 0.99 * HALF_RPM, "{policy}: {again:?}");
    }
}

#[test]
fn zero_throttle_and_a_lost_signal_win_over_a_retry() {
    for signal in [true, false] {
        let mut flight = Flight::turning(&[]);
        let sag = Fault {
            at_s: flight.device.now_ns() as f64 * 1e-9,
            for_s: Some(0.2),
            kind: Kind::BusSag(16.0),
        };
        flight.device.inject(sag);
        // Longer than INP_LOSS_MS, and shorter than the sag.
        let wire = frame(DSHOT600, STOP);
        flight.run(150, |_| signal.then_some(wire));
        assert_ne!(flight.device.esc().telemetry().fault_count, 0);
        let after = flight.run(1_000, |_| signal.then_some(wire));
        assert!(!after.driven, "{signal}: {after:?}");
        let open = flight.send(500, frame(DSHOT600, HALF));
        // Zero throttle has re-armed it; after a lost signal it must be armed again.
        assert_eq!(open.driven, signal, "{open:?}");
    }
}

#[test]
fn commands_at_1_khz_reset_nothing_and_turn_nothing() {
    let mut flight = Flight::new(&[]);
    for value in 1..48 {
        let seen = flight.send(1_000, frame(DSHOT600, value));
        assert!(!seen.driven, "{value}: {seen:?}");
    }
    // It is still the ESC that has obeyed them: saved parameters and all.
    assert_eq!(flight.device.esc().telemetry().fault_count, 0);
    assert!(flight.device.esc().params().get(ParamId::Inp3d) != 0.0);
    flight.send(400, frame(DSHOT600, STOP));
    assert!(flight.is_armed());
}

#[test]
fn in_3d_each_half_of_the_throttle_turns_its_way() {
    let mut flight = Flight::armed(&[(ParamId::Inp3d, 1.0)]);
    // 48 to 1047 are reverse, 1048 to 2047 forward; the middle of each is 3150 rpm.
    flight.send(3_000, frame(DSHOT600, 48 + 500));
    let back = flight.send(100, frame(DSHOT600, 48 + 500));
    assert!((-3250.0..-3050.0).contains(&back.most_rpm), "{back:?}");
    flight.send(3_000, frame(DSHOT600, 1048 + 500));
    let forward = flight.send(100, frame(DSHOT600, 1048 + 500));
    assert!((3050.0..3250.0).contains(&forward.least_rpm), "{forward:?}");
}

#[test]
fn a_command_turns_the_direction_until_the_next_start() {
    let mut flight = Flight::armed(&[]);
    for (command, sign) in [(21, -1.0), (20, 1.0)] {
        flight.send(10, frame(DSHOT600, command));
        flight.send(3_000, frame(DSHOT600, HALF));
        let seen = flight.send(100, frame(DSHOT600, HALF));
        assert!(seen.least_rpm * sign > 3000.0, "{command}: {seen:?}");
        // A command in between is zero throttle, and not obeyed.
        flight.send(10, frame(DSHOT600, 8));
        flight.send(2_000, frame(DSHOT600, STOP));
        assert_eq!(flight.device.esc().params().get(ParamId::MotDir), 0.0);
    }
}
