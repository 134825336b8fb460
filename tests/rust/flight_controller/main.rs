//! What flight controllers send, with their own timing, and what the ESC makes of it.

mod sender;
mod serial;

use sender::{FlightController, STOP};
use siskin_control::params::ParamId;

const BEACON: u16 = 1;
const EXTENDED_ON: u16 = 13;

/// A word of extended telemetry: neither a speed nor the 0xFFF of standstill.
fn is_extended(word: &u16) -> bool {
    word >> 8 != 0 && word & 0x100 == 0
}

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

/// Betaflight restarts, and nobody asks for extended telemetry: it would take the words for speeds.
#[test]
fn extended_telemetry_ends_with_the_signal() {
    let mut fc = FlightController::armed(&[]);
    fc.blocking(EXTENDED_ON);
    assert!(fc.replies().contains(&0xE00));
    fc.frames(1_000, STOP);
    assert!(fc.replies().iter().any(is_extended));
    fc.wait_us(150_000);
    fc.frames(2_000, STOP);
    let words = fc.replies();
    assert!(words.len() > 1_800, "{} replies", words.len());
    assert!(!words.iter().any(is_extended));
}

/// The line is low while the flight controller starts, and the first frame begins with its rise; later
/// every tenth frame or so is spoilt, as Betaflight sends a command ten times.
#[test]
fn a_command_survives_single_bad_frames() {
    let mut fc = FlightController::armed(&[]);
    for bad in 0..10 {
        let direction = if fc.param(ParamId::MotDir) == 0.0 {
            8
        } else {
            7
        };
        for place in 0..10 {
            fc.word(sender::frame(direction) ^ u16::from(place == bad), 1_000);
        }
        fc.frames(2, STOP);
        assert_eq!(fc.param(ParamId::MotDir) == 1.0, direction == 8, "{bad}");
    }
}

/// One bad frame every 0.9 s, and a beacon after each of them.
#[test]
fn a_beacon_is_heard_on_a_wire_with_a_bad_frame_now_and_then() {
    let mut fc = FlightController::armed(&[]);
    for _ in 0..5 {
        fc.word(sender::frame(STOP) ^ 1, 1_000);
        fc.frames(400, STOP);
        fc.heard();
        fc.frames(1, BEACON);
        fc.frames(300, STOP);
        assert!(fc.heard());
        fc.frames(198, STOP);
    }
}
