//! What flight controllers send, with their own timing, and what the ESC makes of it.

mod sender;
mod serial;

use sender::FlightController;
use siskin_control::params::ParamId;

/// PX4 calibrates pulses: full throttle for 3.00 s from the battery's connection on, and then none.
#[test]
fn a_calibration_by_px4_is_taken() {
    let mut fc = FlightController::new(&[]);
    fc.pulses(3_000, 1_940);
    fc.pulses(2_000, 1_060);
    assert!(fc.said("Stick calibration: full taken, now lower it"));
    assert!(fc.said("Stick calibration: both ends taken"));
    let ends = [ParamId::InpPulseMinUs, ParamId::InpPulseMaxUs].map(|id| fc.param(id));
    assert_eq!(ends, [1_060.0, 1_940.0]);
}
