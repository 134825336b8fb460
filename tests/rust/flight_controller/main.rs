//! What flight controllers send, with their own timing, and what the ESC makes of it.

mod noise;
mod sender;
mod serial;

use sender::{FlightController, STOP};
use siskin_params::ParamId;

/// An eighth of the throttle range.
const LOW: u16 = 300;
const BEACON: u16 = 1;
const EXTENDED_ON: u16 = 13;
const EXTENDED_OFF: u16 = 14;
const DIRECTION_2: u16 = 8;
const SAVE: u16 = 12;
const REVERSED: u16 = 21;
const COAST: (ParamId, f32) = (ParamId::MotStop, 0.0);

/// A word of extended telemetry: neither a speed nor the 0xFFF of standstill.
fn is_extended(word: &u16) -> bool {
    word >> 8 != 0 && word & 0x100 == 0
}

/// PX4 calibrates pulses: full throttle for 3.00 s after the battery is connected, then none.
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

/// Betaflight restarts, and nobody asks for extended telemetry: its words would be taken for speeds.
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

/// Betaflight requests extended telemetry at each arming; a pilot who re-arms at once does so while the
/// propeller is still running down.
#[test]
fn extended_telemetry_is_answered_while_the_motor_runs_down() {
    for (command, answer) in [(EXTENDED_ON, 0xE00), (EXTENDED_OFF, 0xEFF)] {
        let mut fc = FlightController::armed(&[COAST]);
        fc.frames(1_500, LOW);
        fc.frames(20, STOP);
        fc.replies();
        fc.blocking(command);
        fc.frames(5, STOP);
        assert!(fc.rpm() > 500.0, "it still turns");
        assert!(fc.replies().contains(&answer), "{answer:03x}");
        // Under throttle it is not a command.
        fc.frames(500, LOW);
        fc.replies();
        fc.frames(5, command);
        fc.frames(5, LOW);
        assert!(!fc.replies().contains(&answer), "{answer:03x}");
    }
}

/// Betaflight's configurator stops the motor, waits 400 ms, and sends the direction and then the save.
#[test]
fn the_configurator_sets_the_direction_of_a_motor_that_coasts() {
    let mut fc = FlightController::armed(&[COAST]);
    fc.frames(2_000, LOW);
    fc.frames(400, STOP);
    assert!(fc.rpm() > 200.0, "it still turns");
    fc.blocking(DIRECTION_2);
    fc.blocking(SAVE);
    assert_eq!(fc.param(ParamId::MotDir), 0.0, "not while it turns");
    for _ in 0..25 {
        fc.frames(1_000, STOP);
    }
    assert_eq!(fc.param(ParamId::MotDir), 1.0);
    // The save followed: this bench has nothing to store on.
    assert!(fc.said("storage: none, nothing would survive a restart"));
    fc.frames(1_500, LOW);
    assert!(fc.rpm() < -200.0, "{} rpm", fc.rpm());
}

/// A command that waits for the motor to rest is dropped if the wire asks for something else first.
#[test]
fn a_command_that_waits_is_forgotten_at_throttle_and_with_the_signal() {
    for lost in [false, true] {
        let mut fc = FlightController::armed(&[COAST]);
        fc.frames(2_000, LOW);
        fc.frames(150, STOP);
        fc.blocking(DIRECTION_2);
        fc.blocking(REVERSED);
        if lost {
            fc.wait_us(350_000);
        } else {
            fc.frames(1_000, LOW);
        }
        for _ in 0..20 {
            fc.frames(1_000, STOP);
        }
        assert!(fc.rpm().abs() < 1.0, "it rests");
        assert_eq!(fc.param(ParamId::MotDir), 0.0);
        fc.frames(1_500, LOW);
        assert!(fc.rpm() > 200.0, "{} rpm", fc.rpm());
    }
}

/// Betaflight's loop blocks for 100 ms after a beacon, and 10 ms more before the next command.
#[test]
fn the_command_after_a_blocking_beacon_is_obeyed() {
    let mut fc = FlightController::armed(&[]);
    fc.blocking(BEACON);
    fc.blocking(DIRECTION_2);
    fc.wait_us(1_000);
    assert_eq!(fc.param(ParamId::MotDir), 1.0);
    assert!(fc.is_armed());
    assert!(!fc.said("Throttle: signal lost while armed"));
    // A longer silence is a loss, and so is this one without a command just before.
    fc.frames(10, BEACON);
    fc.wait_us(350_000);
    assert!(!fc.is_armed());
    fc.frames(400, STOP);
    assert!(fc.is_armed());
    fc.wait_us(102_000);
    assert!(!fc.is_armed());
}

/// The line is low while the flight controller starts, and the first frame begins with its rise; later
/// about every tenth frame is corrupted, as Betaflight sends a command ten times.
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

/// One bad frame every 0.9 s, followed by a beacon.
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
