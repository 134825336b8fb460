//! Commands that turn the motor briefly, make it sound, or set its direction.

use siskin_throttle::authority::DriveStatus;
use siskin_throttle::demand::Reading;

use super::*;
use crate::drive::Fault;

const IN_PROGRESS: MavResult = MavResult::MAV_RESULT_IN_PROGRESS;

const PERCENT: f32 = 0.0;
const PWM: f32 = 1.0;

impl Bench {
    /// Returns the throttle of the test that turns the motor, if any.
    fn tested(&self) -> Option<f32> {
        match self.authority.command() {
            Command::Test(share) => Some(share.to_num()),
            _ => None,
        }
    }

    fn set(&mut self, id: ParamId, value: f32) {
        self.params.set(id, value).expect("in range");
    }

    /// Runs each on a bench of its own.
    fn motor_test(params: &[f32]) -> (u8, Option<f32>) {
        let mut bench = Self::new();
        let result = bench.result(209, params);
        (result, bench.tested())
    }
}

#[test]
fn a_motor_test_is_a_share_of_full_throttle_or_a_pulse() {
    for (kind, throttle, wanted) in [
        (PERCENT, 10.0, 0.1),
        (PERCENT, 100.0, 1.0),
        (PWM, 1100.0, 0.1),
        (PWM, 2000.0, 1.0),
    ] {
        let (result, tested) = Bench::motor_test(&[1.0, kind, throttle, 1.0, 1.0]);
        assert_eq!(result, ACCEPTED as u8);
        let tested = tested.expect("it turns");
        assert!(
            (tested - wanted).abs() < 1e-6,
            "{kind} {throttle}: {tested}"
        );
    }
    // With other end points, and with two directions.
    let mut bench = Bench::new();
    bench.set(ParamId::InpPulseMinUs, 1100.0);
    bench.set(ParamId::InpPulseMaxUs, 1900.0);
    assert_eq!(bench.result(209, &[1.0, PWM, 1300.0, 1.0]), ACCEPTED as u8);
    assert_eq!(bench.tested(), Some(0.25));
    bench.authority.disarm();
    bench.set(ParamId::Inp3d, 1.0);
    bench.authority.set_reading(Reading {
        two_directions: true,
        ..Reading::default()
    });
    assert_eq!(bench.result(209, &[1.0, PWM, 1300.0, 1.0]), ACCEPTED as u8);
    assert_eq!(bench.tested(), Some(-0.5));
}

#[test]
fn a_motor_test_that_cannot_be_is_refused() {
    for params in [
        // Another motor, none, and several.
        [2.0, PERCENT, 10.0, 1.0, 1.0],
        [f32::NAN, PERCENT, 10.0, 1.0, 1.0],
        [1.0, PERCENT, 10.0, 1.0, 2.0],
        // By the pilot's stick, for the compass, and an invalid kind.
        [1.0, 2.0, 10.0, 1.0, 1.0],
        [1.0, 3.0, 10.0, 1.0, 1.0],
        [1.0, f32::NAN, 10.0, 1.0, 1.0],
        [1.0, PERCENT, 100.1, 1.0, 1.0],
        [1.0, PERCENT, -1.0, 1.0, 1.0],
        [1.0, PERCENT, f32::NAN, 1.0, 1.0],
        [1.0, PWM, 999.0, 1.0, 1.0],
        [1.0, PWM, 2001.0, 1.0, 1.0],
        [1.0, PERCENT, 10.0, 3.1, 1.0],
        [1.0, PERCENT, 10.0, -1.0, 1.0],
        [1.0, PERCENT, 10.0, f32::NAN, 1.0],
    ] {
        let refused = (DENIED as u8, None);
        assert_eq!(Bench::motor_test(&params), refused, "{params:?}");
    }
}

#[test]
fn a_motor_test_waits_for_a_motor_at_rest_without_fault() {
    let test = [1.0, PERCENT, 10.0, 1.0];
    let mut bench = Bench::new();
    bench.telemetry.rpm = 500.0;
    assert_eq!(bench.result(209, &test), REJECTED as u8);
    bench.telemetry = TELEMETRY;
    bench.telemetry.faults.insert(Fault::OverCurrent);
    assert_eq!(bench.result(209, &test), REJECTED as u8);
    assert_eq!(bench.tested(), None);
}

#[test]
fn a_motor_test_ends_at_its_time_or_by_one_of_nothing() {
    let test = [1.0, PERCENT, 10.0, 2.0];
    let mut bench = Bench::new();
    for (end, result) in [
        ([1.0, PERCENT, 0.0, 2.0], ACCEPTED),
        ([1.0, PERCENT, 10.0, 0.0], ACCEPTED),
        ([1.0, PWM, 1000.0, 2.0], ACCEPTED),
        ([1.0, PERCENT, 20.0, 2.0], REJECTED),
    ] {
        bench.telemetry = TELEMETRY;
        assert_eq!(bench.result(209, &test), ACCEPTED as u8);
        bench.telemetry.phase = Phase::Run;
        assert_eq!(bench.result(209, &end), result as u8, "{end:?}");
        assert_eq!(bench.tested().is_none(), result == ACCEPTED);
    }
    bench.authority.poll(bench.now_us + 1_999_999);
    assert!(bench.tested().is_some());
    bench.authority.poll(bench.now_us + 2_000_000);
    assert_eq!(bench.tested(), None);
}

#[test]
fn a_motor_test_sent_again_is_the_same_test() {
    let test = [1.0, PERCENT, 10.0, 2.0];
    let mut bench = Bench::new();
    assert_eq!(bench.result(209, &test), ACCEPTED as u8);
    bench.telemetry.phase = Phase::Run;
    for confirmation in [1, 2] {
        bench.receive(&long(ESC, 209, &test, confirmation));
        assert_eq!(acks(&bench.answers()), [(209, ACCEPTED as u8)]);
    }
    assert_eq!(bench.result(209, &test), REJECTED as u8);
}

#[test]
fn what_is_configured_is_stored_before_it_is_acknowledged() {
    let mut bench = Bench::new();
    for (action, id, value) in [
        (2.0, ParamId::Inp3d, 1.0),
        (3.0, ParamId::Inp3d, 0.0),
        (5.0, ParamId::MotDir, 1.0),
        (4.0, ParamId::MotDir, 0.0),
    ] {
        let params = [action, 0.0, 0.0, 0.0, 1.0];
        let sent = bench.command(311, &params);
        assert_eq!(sent.len(), 1, "{sent:?}");
        assert_eq!(values(&sent), [(id as u16, value)]);
        assert_eq!(bench.params.get(id), value);
        assert_eq!(bench.component.take_request(), Some(Request::ParamsChanged));
        assert_eq!(bench.component.take_request(), Some(Request::Save));
        assert_eq!(bench.component.take_request(), None);
        // A repeat is under way, and another one has to wait.
        bench.receive(&long(ESC, 311, &params, 1));
        assert_eq!(acks(&bench.answers()), [(311, IN_PROGRESS as u8)]);
        assert_eq!(bench.result(311, &[1.0]), REJECTED as u8);
        bench.component.storage_done(Ok(()));
        assert_eq!(acks(&bench.answers()), [(311, ACCEPTED as u8)]);
        // That ACK was lost.
        bench.receive(&long(ESC, 311, &params, 2));
        assert_eq!(acks(&bench.answers()), [(311, ACCEPTED as u8)]);
        assert_eq!(bench.component.take_request(), None);
        assert_eq!(values(&bench.run_ms(100)), [], "nothing else has changed");
    }
    assert_eq!(bench.command(311, &[2.0]).len(), 1);
    while bench.component.take_request().is_some() {}
    let reason = "storage: the flash failed";
    bench.component.storage_done(Err(reason));
    let sent = bench.answers();
    assert_eq!(acks(&sent), [(311, FAILED as u8)]);
    assert_eq!(texts(&sent), [reason]);
}

#[test]
fn a_beep_is_asked_for_once() {
    let mut bench = Bench::new();
    assert_eq!(
        bench.result(311, &[1.0, 0.0, 0.0, 0.0, 1.0]),
        ACCEPTED as u8
    );
    assert_eq!(bench.component.take_act(), Some(Act::Beep));
    assert_eq!(bench.result(311, &[0.0]), ACCEPTED as u8);
    assert_eq!(bench.component.take_act(), None);
    assert_eq!(bench.component.take_request(), None);
}

#[test]
fn nothing_is_configured_that_is_not_known_not_this_motor_or_turns() {
    let mut bench = Bench::new();
    let before = bench.params.clone();
    for params in [
        [6.0, 0.0, 0.0, 0.0, 1.0],
        [f32::NAN, 0.0, 0.0, 0.0, 1.0],
        [2.0, 0.0, 0.0, 0.0, 2.0],
        [1.0, 0.0, 0.0, 0.0, f32::NAN],
    ] {
        assert_eq!(bench.result(311, &params), DENIED as u8, "{params:?}");
    }
    bench.telemetry.phase = Phase::Run;
    for action in 1..=5_u8 {
        let result = bench.result(311, &[f32::from(action)]);
        assert_eq!(result, REJECTED as u8, "{action}");
    }
    bench.telemetry = TELEMETRY;
    // A test turns it before the drive says so.
    let at_rest = DriveStatus {
        stopped: true,
        faulted: false,
    };
    let tested = bench
        .authority
        .actuator_test(bench.now_us, 0.1, 1.0, at_rest);
    assert_eq!(tested, Ok(()));
    assert_eq!(bench.result(311, &[1.0]), REJECTED as u8);
    bench.authority.disarm();
    assert_eq!(bench.params, before);
    assert_eq!(bench.component.take_act(), None);
    assert_eq!(bench.component.take_request(), None);
}
