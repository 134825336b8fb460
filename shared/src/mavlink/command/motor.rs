//! Commands that turn the motor briefly, make it sound, or set its direction.

use mavlink::dialects::ardupilotmega::{ActuatorConfiguration, MavResult, MotorTestThrottleType};
use siskin_params::choice::Inp3d;
use siskin_params::{ParamId, Params};
use siskin_throttle::authority::TestError;

use super::{
    ACCEPTED, ACTUATOR_TEST, Act, Command, Commands, Context, DENIED, DriveStatus, Replies,
    Request, TEMPORARILY_REJECTED,
};

const PERCENT: i32 = MotorTestThrottleType::MOTOR_TEST_THROTTLE_PERCENT as i32;
const PWM: i32 = MotorTestThrottleType::MOTOR_TEST_THROTTLE_PWM as i32;

const NOTHING: i32 = ActuatorConfiguration::ACTUATOR_CONFIGURATION_NONE as i32;
const BEEP: i32 = ActuatorConfiguration::ACTUATOR_CONFIGURATION_BEEP as i32;
const TWO_DIRECTIONS: i32 = ActuatorConfiguration::ACTUATOR_CONFIGURATION_3D_MODE_ON as i32;
const ONE_DIRECTION: i32 = ActuatorConfiguration::ACTUATOR_CONFIGURATION_3D_MODE_OFF as i32;
const SPIN_1: i32 = ActuatorConfiguration::ACTUATOR_CONFIGURATION_SPIN_DIRECTION1 as i32;
const SPIN_2: i32 = ActuatorConfiguration::ACTUATOR_CONFIGURATION_SPIN_DIRECTION2 as i32;

impl Commands {
    /// ACTUATOR_TEST and DO_MOTOR_TEST: the authority decides, but never during a self-test.
    pub(super) fn test(
        &self,
        command: &Command,
        drive: DriveStatus,
        context: &mut Context,
    ) -> MavResult {
        let (motor, test) = if command.number == ACTUATOR_TEST {
            let [value, duration_s, _, _, function, ..] = command.params;
            (function, Some((value, duration_s)))
        } else {
            (command.params[0], motor_test(command, context.params))
        };
        let Some((value, duration_s)) = test.filter(|_| self.is_own(motor, command)) else {
            return DENIED;
        };
        if self.checks() {
            return TEMPORARILY_REJECTED;
        }
        let tested = context
            .authority
            .actuator_test(context.now_us, value, duration_s, drive);
        match tested {
            Ok(()) => ACCEPTED,
            Err(TestError::TemporarilyRejected) => TEMPORARILY_REJECTED,
            Err(TestError::OutOfRange) => DENIED,
        }
    }

    /// CONFIGURE_ACTUATOR: does and stores the same as DShot's commands. The ACK follows once
    /// stored.
    pub(super) fn configure(
        &mut self,
        command: &Command,
        drive: DriveStatus,
        context: &mut Context,
        replies: &mut Replies,
    ) -> Option<MavResult> {
        if !self.is_own(command.params[4], command) {
            return Some(DENIED);
        }
        let action = command.choice(0);
        let (id, value) = match action {
            Some(NOTHING | BEEP) => (None, 0.0),
            Some(TWO_DIRECTIONS) => (Some(ParamId::Inp3d), 1.0),
            Some(ONE_DIRECTION) => (Some(ParamId::Inp3d), 0.0),
            Some(SPIN_1) => (Some(ParamId::MotDir), 0.0),
            Some(SPIN_2) => (Some(ParamId::MotDir), 1.0),
            _ => return Some(DENIED),
        };
        if self.is_busy() || !drive.stopped {
            return Some(TEMPORARILY_REJECTED);
        }
        let Some(id) = id else {
            self.act = (action == Some(BEEP)).then_some(Act::Beep);
            return Some(ACCEPTED);
        };
        // Both are in range.
        let _ = context.params.set(id, value);
        replies.value(id);
        self.params_changed = true;
        self.storage = Some(*command);
        self.request = Some(Request::Save);
        None
    }
}

/// Converts DO_MOTOR_TEST's value and time to ACTUATOR_TEST's: a share of full throttle, or a pulse
/// between the wire's end points. Returns `None` for an unsupported kind of throttle, and for
/// several motors.
fn motor_test(command: &Command, params: &Params) -> Option<(f32, f32)> {
    let [_, _, throttle, duration_s, motors, ..] = command.params;
    let value = match command.choice(1) {
        Some(PERCENT) => throttle / 100.0,
        Some(PWM) => {
            let min_us = params.get(ParamId::InpPulseMinUs);
            let share = (throttle - min_us) / (params.get(ParamId::InpPulseMaxUs) - min_us);
            if params.chosen(Inp3d::Off) {
                share
            } else {
                2.0 * share - 1.0
            }
        }
        _ => return None,
    };
    if value.is_nan() || motors > 1.0 {
        return None;
    }
    // Ground stations end a test by one with no throttle or no time; ACTUATOR_TEST does by NaN.
    let ends = value == 0.0 || duration_s == 0.0;
    Some((if ends { f32::NAN } else { value }, duration_s))
}
