//! RUN_PREARM_CHECKS: the self-test.

use super::*;

const IN_PROGRESS: u8 = MavResult::MAV_RESULT_IN_PROGRESS as u8;
const RUN: u16 = 401;
const IDENTIFY: u16 = 31010;

/// Returns result and progress of the one ACK.
fn ack(sent: &[Sent]) -> (u8, u8) {
    let [ack] = sent else { panic!("one answer") };
    (ack.payload[2], ack.payload[3])
}

#[test]
fn a_self_test_is_acknowledged_step_by_step() {
    for (passed, result) in [(true, ACCEPTED), (false, FAILED)] {
        let mut bench = Bench::new();
        assert_eq!(ack(&bench.command(RUN, &[])), (IN_PROGRESS, 255));
        assert_eq!(bench.component.take_act(), Some(Act::Check));
        bench.component.report_progress(40);
        assert_eq!(ack(&bench.answers()), (IN_PROGRESS, 40));
        // Resent, and what must not interrupt it; the stick calibration is separate.
        bench.receive(&long(ESC, RUN, &[], 1));
        assert_eq!(ack(&bench.answers()), (IN_PROGRESS, 255));
        assert_eq!(bench.component.take_act(), None);
        assert_eq!(bench.result(RUN, &[]), REJECTED as u8);
        assert_eq!(bench.result(245, &[1.0]), REJECTED as u8);
        let test = [0.1, 1.0, 0.0, 0.0, 1.0];
        assert_eq!(bench.result(310, &test), REJECTED as u8);
        assert_eq!(bench.component.take_act(), Some(Act::SayWhyOff));
        assert_eq!(bench.result(241, &[0.0; 7]), ACCEPTED as u8);
        bench.component.report_stored(Ok(()));
        assert_eq!(acks(&bench.answers()), []);
        bench.component.check_done(passed);
        assert_eq!(ack(&bench.answers()), (result as u8, 0));
        bench.receive(&long(ESC, RUN, &[], 2));
        assert_eq!(ack(&bench.answers()), (result as u8, 0));
        assert_eq!(bench.component.take_act(), None);
        // Self-tests that nobody requested are not reported.
        bench.component.check_done(passed);
        bench.component.report_progress(50);
        assert_eq!(bench.answers().len(), 0);
    }
}

#[test]
fn the_end_of_another_self_test_is_not_an_identification_s() {
    let mut bench = Bench::new();
    assert_eq!(ack(&bench.command(IDENTIFY, &[1.0])), (IN_PROGRESS, 255));
    bench.component.check_done(true);
    assert_eq!(acks(&bench.answers()), []);
    bench.component.identification_done(true);
    assert_eq!(ack(&bench.answers()), (ACCEPTED as u8, 0));
}

#[test]
fn it_needs_a_motor_at_rest_without_a_fault() {
    let mut bench = Bench::new();
    bench.telemetry.rpm = 500.0;
    assert_eq!(bench.result(RUN, &[]), REJECTED as u8);
    bench.telemetry.rpm = 0.0;
    bench.telemetry.faults.insert(Fault::OverCurrent);
    assert_eq!(bench.result(RUN, &[]), REJECTED as u8);
    assert_eq!(bench.component.take_act(), None);
}

#[test]
fn a_peripheral_leaves_what_all_are_asked_to_the_autopilot() {
    let (mut bench, _) = peripheral();
    bench.receive(&long(
        Address {
            system: 1,
            component: 0,
        },
        RUN,
        &[],
        0,
    ));
    assert_eq!(acks(&bench.answers()), []);
    assert_eq!(bench.component.take_act(), None);
}
