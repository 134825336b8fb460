//! Ground station requests besides turning the motor: at rest, as the wire would make them.

use super::*;
use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, MavCmd};

const ACCEPTED: MavResult = MavResult::MAV_RESULT_ACCEPTED;
const CANCELLED: MavResult = MavResult::MAV_RESULT_CANCELLED;
const FAILED: MavResult = MavResult::MAV_RESULT_FAILED;
const IN_PROGRESS: MavResult = MavResult::MAV_RESULT_IN_PROGRESS;
const REJECTED: MavResult = MavResult::MAV_RESULT_TEMPORARILY_REJECTED;

impl Bench {
    /// Configures this ESC's motor.
    fn configure(&mut self, action: f32) {
        self.message(&COMMAND_LONG_DATA {
            param1: action,
            param5: 1.0,
            command: MavCmd::MAV_CMD_CONFIGURE_ACTUATOR,
            target_system: 1,
            target_component: 1,
            ..COMMAND_LONG_DATA::default()
        });
    }

    fn calibrate(&mut self, esc: f32) {
        self.message(&COMMAND_LONG_DATA {
            param7: esc,
            command: MavCmd::MAV_CMD_PREFLIGHT_CALIBRATION,
            target_system: 1,
            target_component: 1,
            ..COMMAND_LONG_DATA::default()
        });
    }

    fn take_results(&mut self) -> Vec<MavResult> {
        core::mem::take(&mut self.results)
    }

    /// Armed by pulses of no throttle, after a first signal that did not calibrate.
    fn armed_by_pulses() -> Self {
        let mut bench = Self::new();
        bench.pulses(60, 1000);
        assert!(bench.esc.telemetry().armed);
        bench.requests.clear();
        bench
    }
}

/// It would store all other settings too, which are the defaults.
#[test]
fn a_direction_does_not_store_settings_that_were_lost() {
    let mut bench = Bench::new();
    bench.esc.lose_stored();
    bench.frames(2_000, 0);
    bench.configure(5.0);
    bench.frames(1_000, 0);
    assert_eq!(bench.requests, [Request::ParamsChanged]);
    assert_eq!(bench.take_results(), [FAILED]);
    let lost = "Settings lost: set and store, or reset";
    assert_eq!(bench.texts.last().map(String::as_str), Some(lost));
    assert!(!bench.esc.telemetry().armed);
    // Once those are stored in their own right, so is it.
    bench.command(MavCmd::MAV_CMD_PREFLIGHT_STORAGE, 1.0);
    bench.frames(2, 0);
    bench.storage_done(Ok(()));
    bench.configure(4.0);
    bench.frames(2, 0);
    let save = [Request::ParamsChanged, Request::Save];
    assert_eq!(bench.requests[1..], [&[Request::Save], &save[..]].concat());
}

#[test]
fn a_direction_is_in_force_at_once_and_acknowledged_when_it_is_stored() {
    let mut bench = Bench::armed();
    bench.configure(5.0);
    bench.frames(2, 0);
    assert_eq!(bench.config().direction, Direction::Reversed);
    assert_eq!(bench.requests, [Request::ParamsChanged, Request::Save]);
    assert_eq!(bench.take_results(), []);
    bench.storage_done(Ok(()));
    assert_eq!(bench.take_results(), [ACCEPTED]);

    // While the wire turns the motor, nothing happens.
    bench.requests.clear();
    bench.frames(4, 1000);
    for action in [1.0, 2.0, 4.0] {
        bench.configure(action);
        bench.frames(1, 1000);
        assert_eq!(bench.take_results(), [REJECTED]);
    }
    assert_eq!(bench.config().direction, Direction::Reversed);
    assert_eq!(bench.requests, []);
}

#[test]
fn a_beep_is_heard() {
    let mut bench = Bench::armed();
    bench.configure(1.0);
    bench.frames(100, 0);
    let mut player = Player::default();
    player.play(0, Tune::Beacon(Beacon::One));
    assert_eq!(bench.notes.first().copied(), player.note(0));
    assert_eq!(bench.take_results(), [ACCEPTED]);
}

/// The stick comes up while the wire is armed: it must teach, not turn the motor.
#[test]
fn a_calibration_on_request_takes_the_stick_and_never_turns_the_motor() {
    let mut bench = Bench::armed_by_pulses();
    bench.calibrate(1.0);
    bench.pulses(1, 1000);
    assert_eq!(bench.take_results(), [IN_PROGRESS]);
    assert!(!bench.esc.telemetry().armed);
    // However long the stick stays down, it does not arm.
    bench.pulses(100, 1000);
    assert!(!bench.esc.telemetry().armed);
    for width_us in [1300, 1600, 1912] {
        bench.pulses(3, width_us);
        let setpoint = bench.throttle.setpoint();
        assert!(matches!(setpoint, Setpoint::Stop | Setpoint::Tone(_)));
    }
    bench.pulses(180, 1912);
    assert_eq!(bench.take_results(), [IN_PROGRESS]);
    bench.pulses(78, 1105);
    assert_eq!(bench.get(ParamId::InpPulseMaxUs), 1912.0);
    assert_eq!(bench.get(ParamId::InpPulseMinUs), 1105.0);
    assert_eq!(bench.take_results(), []);
    bench.pulses(60, 1105);
    assert!(bench.esc.telemetry().armed, "by its new zero");
    assert_eq!(bench.requests, [Request::ParamsChanged, Request::Save]);
    bench.storage_done(Ok(()));
    assert_eq!(bench.take_results(), [ACCEPTED]);
}

#[test]
fn a_calibration_that_is_not_followed_changes_nothing_and_gives_the_wire_back() {
    // Ended by a command, by a stick that stays down for a minute, and by a lost signal.
    for end in 0..3 {
        let mut bench = Bench::armed_by_pulses();
        bench.calibrate(1.0);
        bench.pulses(1, 1000);
        bench.take_results();
        let result = match end {
            0 => {
                bench.calibrate(0.0);
                &[CANCELLED, ACCEPTED][..]
            }
            1 => {
                bench.pulses(3_000, 1000);
                &[FAILED]
            }
            _ => {
                bench.wait_ms(150);
                &[FAILED]
            }
        };
        bench.pulses(2, 1000);
        assert_eq!(bench.take_results(), result, "{end}");
        bench.pulses(60, 1000);
        assert!(bench.esc.telemetry().armed, "{end}");
        assert_eq!(bench.esc.params(), &Params::of(&BOSSO_MOTOR));
        assert_eq!(bench.requests, []);
    }
}
