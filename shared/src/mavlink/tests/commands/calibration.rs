//! PREFLIGHT_CALIBRATION: the throttle end points, by stick.

use siskin_throttle::News;
use siskin_throttle::calibration::Step;
use siskin_throttle::endpoints::EndPoints;
use siskin_throttle::signal::{Pulse, Signal};

use super::*;

const CANCELLED: MavResult = MavResult::MAV_RESULT_CANCELLED;
const IN_PROGRESS: MavResult = MavResult::MAV_RESULT_IN_PROGRESS;

/// The ESC, and nothing else.
const BEGIN: [f32; 7] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
const END: [f32; 7] = [0.0; 7];

/// Returns a bench with a calibration under way.
fn begun() -> Bench {
    let mut bench = Bench::new();
    bench.telemetry.signal = Some(Signal::Pulse(Pulse::Servo));
    assert_eq!(bench.result(241, &BEGIN), IN_PROGRESS as u8);
    assert_eq!(bench.component.take_act(), Some(Act::Calibrate));
    bench
}

impl Bench {
    fn step(&mut self, step: Step) -> Vec<(u16, u8)> {
        self.component.report_news(News::Calibration(step));
        acks(&self.answers())
    }
}

#[test]
fn a_calibration_is_acknowledged_step_by_step_and_when_it_is_stored() {
    for (stored, result) in [(Ok(()), ACCEPTED), (Err("storage: worn out"), FAILED)] {
        let mut bench = begun();
        // Resent, and other long commands.
        bench.receive(&long(ESC, 241, &BEGIN, 1));
        assert_eq!(acks(&bench.answers()), [(241, IN_PROGRESS as u8)]);
        assert_eq!(bench.component.take_act(), None);
        assert_eq!(bench.result(241, &BEGIN), REJECTED as u8);
        assert_eq!(bench.result(245, &[1.0]), REJECTED as u8);
        assert_eq!(bench.result(246, &[1.0]), REJECTED as u8);
        assert_eq!(bench.result(311, &[2.0]), REJECTED as u8);

        assert_eq!(bench.step(Step::Full), [(241, IN_PROGRESS as u8)]);
        let ends = EndPoints {
            min_us: 1105,
            max_us: 1912,
        };
        assert_eq!(bench.step(Step::Done(ends)), []);
        bench.component.report_stored(stored);
        assert_eq!(acks(&bench.answers()), [(241, result as u8)]);
        // That ACK was lost.
        bench.receive(&long(ESC, 241, &BEGIN, 2));
        assert_eq!(acks(&bench.answers()), [(241, result as u8)]);
        assert_eq!(bench.component.take_act(), None);
        // Another one is new.
        assert_eq!(bench.result(241, &BEGIN), IN_PROGRESS as u8);
    }
}

#[test]
fn a_calibration_that_comes_to_nothing_has_failed() {
    let mut bench = begun();
    assert_eq!(bench.step(Step::Cancelled), [(241, FAILED as u8)]);
    assert_eq!(bench.step(Step::Cancelled), []);
    assert_eq!(bench.step(Step::Full), [], "by the stick alone");
}

#[test]
fn all_zeros_end_a_calibration() {
    let mut bench = Bench::new();
    assert_eq!(bench.result(241, &END), ACCEPTED as u8);
    assert_eq!(bench.component.take_act(), None);
    let mut bench = begun();
    let acks = acks(&bench.command(241, &END));
    assert_eq!(acks, [(241, CANCELLED as u8), (241, ACCEPTED as u8)]);
    assert_eq!(bench.component.take_act(), Some(Act::EndCalibration));
    assert_eq!(bench.step(Step::Cancelled), [], "told already");
}

#[test]
fn what_an_esc_has_not_is_not_calibrated() {
    for (at, value) in [
        (0, 1.0),
        (1, 1.0),
        (2, 1.0),
        (3, 1.0),
        (4, 1.0),
        (5, 1.0),
        (6, 3.0),
        (6, f32::NAN),
    ] {
        let mut params = END;
        params[at] = value;
        let mut bench = Bench::new();
        assert_eq!(bench.result(241, &params), DENIED as u8, "{params:?}");
        assert_eq!(bench.component.take_act(), None);
    }
    // Two at once.
    let mut params = BEGIN;
    params[0] = 1.0;
    assert_eq!(Bench::new().result(241, &params), DENIED as u8);
    // DShot's throttle has no ends, and a turning motor has a throttle.
    let mut bench = Bench::new();
    bench.telemetry.signal = Signal::from_number(12);
    assert_eq!(bench.result(241, &BEGIN), DENIED as u8);
    bench.telemetry.signal = None;
    bench.telemetry.rpm = 500.0;
    assert_eq!(bench.result(241, &BEGIN), REJECTED as u8);
    assert_eq!(bench.component.take_act(), None);
}
