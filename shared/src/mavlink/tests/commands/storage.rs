//! Commands about stored parameters and the restart.

use super::*;

#[test]
fn a_save_is_acknowledged_when_it_is_done() {
    let mut bench = Bench::new();
    assert_eq!(bench.command(245, &[1.0]).len(), 0);
    assert_eq!(bench.component.take_request(), Some(Request::Save));
    assert_eq!(bench.component.take_request(), None);
    // Another one has to wait; the same one, resent, is under way.
    assert_eq!(bench.result(245, &[2.0]), REJECTED as u8);
    assert_eq!(bench.result(246, &[1.0]), REJECTED as u8);
    bench.receive(&long(ESC, 245, &[1.0], 1));
    assert_eq!(
        acks(&bench.answers()),
        [(245, MavResult::MAV_RESULT_IN_PROGRESS as u8)]
    );
    assert_eq!(bench.component.take_request(), None);

    bench.component.storage_done(Ok(()));
    assert_eq!(acks(&bench.answers()), [(245, ACCEPTED as u8)]);
    // That ACK was lost.
    bench.receive(&long(ESC, 245, &[1.0], 2));
    assert_eq!(acks(&bench.answers()), [(245, ACCEPTED as u8)]);
    assert_eq!(bench.component.take_request(), None);
    // No longer a repeat: stores again, and fails.
    assert_eq!(bench.command(245, &[1.0]).len(), 0);
    assert_eq!(bench.component.take_request(), Some(Request::Save));
    bench
        .component
        .storage_done(Err("storage: the flash failed"));
    let sent = bench.answers();
    assert_eq!(acks(&sent), [(245, FAILED as u8)]);
    assert_eq!(texts(&sent), ["storage: the flash failed"]);
    // Nothing was requested.
    bench.component.storage_done(Ok(()));
    assert_eq!(bench.answers().len(), 0);
}

#[test]
fn a_reset_shows_every_value_again() {
    let mut bench = Bench::new();
    for (action, request) in [(0.0, Request::Load), (2.0, Request::FactoryReset)] {
        assert_eq!(bench.command(245, &[action]).len(), 0);
        assert_eq!(bench.component.take_request(), Some(request));
        bench.component.storage_done(Ok(()));
        let sent = bench.run_ms(100);
        assert_eq!(acks(&sent), [(245, ACCEPTED as u8)]);
        assert_eq!(values(&sent).len(), ParamId::ALL.len());
    }
    assert_eq!(bench.result(245, &[9.0]), DENIED as u8);
    assert_eq!(bench.result(245, &[-1.0]), ACCEPTED as u8);
    assert_eq!(bench.component.take_request(), None);
}

#[test]
fn storage_and_restart_wait_for_a_motor_at_rest() {
    let mut bench = Bench::new();
    bench.telemetry.phase = Phase::Run;
    bench.telemetry.rpm = 3000.0;
    for action in [0.0, 1.0, 2.0] {
        assert_eq!(bench.result(245, &[action]), REJECTED as u8);
    }
    assert_eq!(bench.result(246, &[1.0]), REJECTED as u8);
    assert_eq!(bench.component.take_request(), None);
    bench.telemetry = TELEMETRY;

    assert_eq!(bench.result(246, &[3.0]), DENIED as u8);
    bench.receive(&long(ESC, 246, &[1.0], 0));
    assert_eq!(bench.component.take_request(), None, "the ACK first");
    assert_eq!(acks(&bench.answers()), [(246, ACCEPTED as u8)]);
    assert_eq!(bench.component.take_request(), Some(Request::Reboot));
}
