//! Commands. Each one addressed to this ESC gets a COMMAND_ACK.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    AUTOPILOT_VERSION_DATA, COMMAND_INT_DATA, MESSAGE_INTERVAL_DATA, MavCmd, MavResult, MavSeverity,
};
use siskin_throttle::authority::{self, DriveStatus};
use siskin_units::math::round;

use super::context::{Act, Context, Request};
use super::frame::Address;
use super::frame::{Frame, is_signed};
use super::ftp;
use super::identity::{Identity, Role};
use super::reply::{Replies, Reply};
use super::schedule::{Interval, Schedule};
use super::signing::Trust;

mod calibration;
mod check;
mod motor;

const DO_MOTOR_TEST: u16 = MavCmd::MAV_CMD_DO_MOTOR_TEST as u16;
const ACTUATOR_TEST: u16 = MavCmd::MAV_CMD_ACTUATOR_TEST as u16;
const CONFIGURE_ACTUATOR: u16 = MavCmd::MAV_CMD_CONFIGURE_ACTUATOR as u16;
const PREFLIGHT_CALIBRATION: u16 = MavCmd::MAV_CMD_PREFLIGHT_CALIBRATION as u16;
const PREFLIGHT_STORAGE: u16 = MavCmd::MAV_CMD_PREFLIGHT_STORAGE as u16;
const PREFLIGHT_REBOOT_SHUTDOWN: u16 = MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN as u16;
pub(super) const RUN_PREARM_CHECKS: u16 = MavCmd::MAV_CMD_RUN_PREARM_CHECKS as u16;
/// The dialect has none for it.
pub(super) const IDENTIFY: u16 = MavCmd::MAV_CMD_USER_1 as u16;
const COMPONENT_ARM_DISARM: u16 = MavCmd::MAV_CMD_COMPONENT_ARM_DISARM as u16;
/// By number: the dialect marks it as superseded, but clients still send it.
const GET_MESSAGE_INTERVAL: u16 = 510;
const SET_MESSAGE_INTERVAL: u16 = MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL as u16;
const REQUEST_MESSAGE: u16 = MavCmd::MAV_CMD_REQUEST_MESSAGE as u16;

pub(super) const ACCEPTED: MavResult = MavResult::MAV_RESULT_ACCEPTED;
const CANCELLED: MavResult = MavResult::MAV_RESULT_CANCELLED;
const DENIED: MavResult = MavResult::MAV_RESULT_DENIED;
pub(super) const FAILED: MavResult = MavResult::MAV_RESULT_FAILED;
const IN_PROGRESS: MavResult = MavResult::MAV_RESULT_IN_PROGRESS;
const TEMPORARILY_REJECTED: MavResult = MavResult::MAV_RESULT_TEMPORARILY_REJECTED;
const UNSUPPORTED: MavResult = MavResult::MAV_RESULT_UNSUPPORTED;

/// Message ids have 24 bits.
const MESSAGE_MAX: f32 = 16_777_215.0;
/// The slowest interval on request, 2^31 - 128 µs: MESSAGE_INTERVAL is an i32, and this is the greatest f32 below its
/// end.
const INTERVAL_MAX_US: f32 = 2_147_483_520.0;

/// Why a restart is refused, or abandoned.
pub(crate) const NO_REBOOT_ARMED: &str = "No reboot: armed";

/// Time within which a repeated command counts as the same one; clients give up after 3 s or less.
const REPEAT_US: u64 = 5_000_000;
/// The same for COMMAND_INT, which has no transmission number: as long as a client waits for an ACK, and hardly as long
/// as a person takes to ask for the same again.
const REPEAT_INT_US: u64 = 1_000_000;

/// A command, as carried by COMMAND_LONG and COMMAND_INT. The number is raw: the dialect may not have it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Command {
    from: Address,
    trust: Trust,
    signed: bool,
    at_us: u64,
    /// True if it addresses exactly this component of this system.
    exact: bool,
    number: u16,
    /// The transmission number, which COMMAND_INT lacks.
    confirmation: Option<u8>,
    params: [f32; 7],
}

impl Command {
    /// Reads either message; they differ only in parameters 5 and 6 and after the target.
    pub(super) fn read(now_us: u64, frame: &Frame, trust: Trust, exact: bool) -> Self {
        let mut params = [0.0; 7];
        for (i, param) in params.iter_mut().enumerate() {
            *param = frame.f32(4 * i);
        }
        let mut confirmation = Some(frame.u8(32));
        if frame.id == COMMAND_INT_DATA::ID {
            params[4] = frame.i32(16) as f32;
            params[5] = frame.i32(20) as f32;
            // In COMMAND_INT that byte is the coordinate frame.
            confirmation = None;
        }
        Self {
            from: frame.from,
            trust,
            signed: is_signed(frame.raw),
            at_us: now_us,
            exact,
            number: frame.u16(28),
            confirmation,
            params,
        }
    }

    /// Makes a write of MOT_IDENTIFY the command with the same number.
    pub(super) fn identify(now_us: u64, frame: &Frame) -> Self {
        let mut params = [0.0; 7];
        params[0] = frame.f32(0);
        Self {
            from: frame.from,
            trust: Trust::Full,
            signed: false,
            at_us: now_us,
            exact: true,
            number: IDENTIFY,
            confirmation: None,
            params,
        }
    }

    /// Returns a parameter if it is a whole number from -1 up.
    fn choice(&self, parameter: usize) -> Option<i32> {
        let value = self.params[parameter];
        let whole = value as i32;
        (whole as f32 == value && whole >= -1).then_some(whole)
    }

    /// Returns true if its sender may have it obeyed: those who may only ask get messages.
    fn is_allowed(&self) -> bool {
        self.trust == Trust::Full || self.asks()
    }

    /// Returns true if it would have the motor turn, now or by the throttle.
    fn energises(&self) -> bool {
        let number = self.number;
        matches!(
            number,
            COMPONENT_ARM_DISARM | DO_MOTOR_TEST | ACTUATOR_TEST | IDENTIFY
        )
    }

    fn asks(&self) -> bool {
        matches!(self.number, REQUEST_MESSAGE | GET_MESSAGE_INTERVAL)
    }

    /// Returns true if obeying it leaves something to store: an interval, or the time of a signature, so that an obeyed
    /// command is not obeyed again after a reset.
    fn leaves(&self) -> bool {
        self.number == SET_MESSAGE_INTERVAL || (self.signed && !self.asks())
    }

    /// Returns true if this is the same command, resent because its ACK was lost. Values are compared by their bits:
    /// NaN is a valid value.
    fn repeats(&self, earlier: &Self) -> bool {
        let most_us = if self.confirmation.is_some() {
            REPEAT_US
        } else {
            REPEAT_INT_US
        };
        self.at_us.saturating_sub(earlier.at_us) <= most_us && self.is_again(earlier)
    }

    /// Returns true if this is the same command, resent at any time: while one is under way, that asks for its
    /// progress.
    fn is_again(&self, earlier: &Self) -> bool {
        let transmitted_later = match (self.confirmation, earlier.confirmation) {
            (Some(now), Some(then)) => now > then,
            (now, then) => now == then,
        };
        transmitted_later
            && self.from == earlier.from
            && self.number == earlier.number
            && self.params.map(f32::to_bits) == earlier.params.map(f32::to_bits)
    }
}

/// The ESC's commands and their state.
#[derive(Clone, Debug)]
pub(super) struct Commands {
    role: Role,
    /// `ACTUATOR_OUTPUT_FUNCTION` of the motor.
    function: f32,
    /// The command that finishes when the parameters have been stored, loaded or erased.
    storage: Option<Command>,
    /// The calibration or self-test under way.
    under_way: Option<Command>,
    /// When the client that began it last sent a heartbeat, µs; it wraps in over an hour.
    beat_us: Option<u32>,
    /// The last command that must not be obeyed twice, and its result.
    last: Option<(Command, MavResult)>,
    act: Option<Act>,
    params_changed: bool,
    request: Option<Request>,
    reboot: bool,
    /// True if a command has left something to store.
    left: bool,
}

impl Commands {
    pub(super) fn new(identity: &Identity) -> Self {
        Self {
            role: identity.role,
            function: identity.place.motor_function(),
            storage: None,
            under_way: None,
            beat_us: None,
            last: None,
            act: None,
            params_changed: false,
            request: None,
            reboot: false,
            left: false,
        }
    }

    pub(super) fn handle(
        &mut self,
        command: &Command,
        drive: DriveStatus,
        context: &mut Context,
        schedule: &mut Schedule,
        replies: &mut Replies,
    ) {
        if !command.is_allowed() {
            // Others may have been addressed as well.
            if command.exact || self.role == Role::Standalone {
                replies.ack(command.from, command.number, DENIED);
            }
            return;
        }
        let earlier = self
            .last
            .filter(|(last, _)| command.repeats(last) && is_known(command, context));
        // Only one of the two at a time.
        let pending = self.storage.as_ref().or(self.under_way.as_ref());
        let result = match (pending, earlier) {
            (Some(pending), _) if command.is_again(pending) => Some(IN_PROGRESS),
            (_, Some((_, result))) => Some(result),
            _ => self.obey(command, drive, context, schedule, replies),
        };
        let waits = result.is_none() && self.storage.is_some();
        let is_taken = waits || matches!(result, Some(ACCEPTED | IN_PROGRESS));
        self.left |= is_taken && command.leaves();
        if let Some(result) = result {
            replies.ack(command.from, command.number, result);
        }
        let is_refused = matches!(result, Some(DENIED | TEMPORARILY_REJECTED));
        if is_refused && command.energises() {
            self.act = self.act.or(Some(Act::SayWhyOff));
        }
        if command.number == REQUEST_MESSAGE && result == Some(ACCEPTED) {
            replies.push(requested_message(command));
        }
        if command.number == GET_MESSAGE_INTERVAL && result == Some(ACCEPTED) {
            replies.push(Reply::Interval(command.params[0] as u16));
        }
    }

    /// Returns the result, or `None` if it comes later or not at all.
    fn obey(
        &mut self,
        command: &Command,
        drive: DriveStatus,
        context: &mut Context,
        schedule: &mut Schedule,
        replies: &mut Replies,
    ) -> Option<MavResult> {
        let [p1, p2, ..] = command.params;
        Some(match command.number {
            DO_MOTOR_TEST | ACTUATOR_TEST => {
                let result = self.test(command, drive, context);
                self.last = Some((*command, result));
                result
            }
            CONFIGURE_ACTUATOR => return self.configure(command, drive, context, replies),
            PREFLIGHT_CALIBRATION => self.calibrate(command, drive, context, replies),
            RUN_PREARM_CHECKS if command.exact || self.role == Role::Standalone => {
                self.measure(command, Act::Check, drive, context)
            }
            IDENTIFY if command.exact => self.identify(command, drive, context, replies),
            COMPONENT_ARM_DISARM => {
                let arm = command.choice(0);
                if arm == Some(0) {
                    self.act = Some(Act::EndIdentification);
                }
                arm_disarm(arm, context)
            }
            PREFLIGHT_STORAGE => return self.storage(command, drive),
            PREFLIGHT_REBOOT_SHUTDOWN => self.reboot(command, drive, context, replies),
            REQUEST_MESSAGE => request_message(command, schedule),
            SET_MESSAGE_INTERVAL => set_interval(p1, p2, schedule),
            GET_MESSAGE_INTERVAL => match message_id(p1) {
                Some(id) if u16::try_from(id).is_ok() => ACCEPTED,
                _ => DENIED,
            },
            // A broadcast command is for those who know it: an autopilot answers it, and its ESCs would only add
            // refusals.
            _ if command.exact || self.role == Role::Standalone => UNSUPPORTED,
            _ => return None,
        })
    }

    /// Returns true if something under way must not be interrupted by another command.
    fn is_busy(&self) -> bool {
        self.storage.is_some() || self.under_way.is_some() || self.reboot
    }

    /// Returns true if a command means this ESC's motor by this number. No number in particular means it only if nobody
    /// else was addressed.
    fn is_own(&self, function: f32, command: &Command) -> bool {
        function == self.function || (function == 0.0 && command.exact)
    }

    /// Stores, loads or resets the parameters, at rest only: flash access stalls the processor, and loading changes
    /// what drives the motor. The ACK follows on completion.
    fn storage(&mut self, command: &Command, drive: DriveStatus) -> Option<MavResult> {
        let request = match command.choice(0) {
            Some(-1) => return Some(ACCEPTED),
            Some(0) => Request::Load,
            Some(1) => Request::Save,
            Some(2 | 4) => Request::FactoryReset,
            _ => return Some(DENIED),
        };
        if self.is_busy() || !drive.stopped {
            return Some(TEMPORARILY_REJECTED);
        }
        self.storage = Some(*command);
        self.request = Some(request);
        None
    }

    /// Returns true if the pending storage command asks for nothing else.
    pub(super) fn stores_all(&self) -> bool {
        let command = self.storage.as_ref();
        command.is_some_and(|command| command.number == PREFLIGHT_STORAGE)
    }

    /// Completes the pending storage command.
    pub(super) fn storage_done(
        &mut self,
        result: Result<(), &'static str>,
        replies: &mut Replies,
    ) -> bool {
        let Some(command) = self.storage.take() else {
            return false;
        };
        let code = if result.is_ok() { ACCEPTED } else { FAILED };
        self.last = Some((command, code));
        replies.ack(command.from, command.number, code);
        if let Err(reason) = result {
            replies.text(MavSeverity::MAV_SEVERITY_ERROR, reason);
        }
        // A reset or a load changes every value: clients should see the new ones.
        code == ACCEPTED && command.number == PREFLIGHT_STORAGE && command.choice(0) != Some(1)
    }

    fn reboot(
        &mut self,
        command: &Command,
        drive: DriveStatus,
        context: &mut Context,
        replies: &mut Replies,
    ) -> MavResult {
        match command.choice(0) {
            Some(0) => return ACCEPTED,
            Some(1) => {}
            // An ESC cannot shut down or stay in a boot loader.
            _ => return DENIED,
        }
        if self.is_busy() || !drive.stopped {
            return TEMPORARILY_REJECTED;
        }
        // The pilot may open the throttle at any moment.
        if context.authority.armed() {
            replies.text(MavSeverity::MAV_SEVERITY_WARNING, NO_REBOOT_ARMED);
            return TEMPORARILY_REJECTED;
        }
        self.reboot = true;
        replies.text(MavSeverity::MAV_SEVERITY_INFO, "Rebooting");
        ACCEPTED
    }

    /// Ends the given command with a result, if it is under way.
    pub(super) fn end(&mut self, number: u16, result: MavResult, replies: &mut Replies) {
        if let Some(command) = self.under_way.take_if(|command| command.number == number) {
            self.last = Some((command, result));
            replies.ack(command.from, command.number, result);
        }
    }

    /// Returns the next thing for the ESC to do.
    pub(super) fn take_act(&mut self) -> Option<Act> {
        self.act.take()
    }

    /// Returns true if a command has left something to store since the last call.
    pub(super) fn take_left(&mut self) -> bool {
        core::mem::take(&mut self.left)
    }

    /// Returns the next request. A reboot waits for its ACK: `replies_sent` is true if no reply is pending.
    pub(super) fn take_request(&mut self, replies_sent: bool) -> Option<Request> {
        if core::mem::take(&mut self.params_changed) {
            return Some(Request::ParamsChanged);
        }
        if let Some(request) = self.request.take() {
            return Some(request);
        }
        if self.reboot && replies_sent {
            self.reboot = false;
            return Some(Request::Reboot);
        }
        None
    }
}

/// Returns true if a command that looks like an earlier one is the same: by its transmission number, or if it has none,
/// because the test that it asked for still runs.
fn is_known(command: &Command, context: &mut Context) -> bool {
    let tests = matches!(context.authority.command(), authority::Command::Test(_));
    let is_test = matches!(command.number, DO_MOTOR_TEST | ACTUATOR_TEST);
    command.confirmation.is_some() || (is_test && tests)
}

fn arm_disarm(arm: Option<i32>, context: &mut Context) -> MavResult {
    match arm {
        Some(0) => context.authority.disarm(),
        Some(1) if context.authority.arm(context.now_us).is_ok() => {}
        _ => return DENIED,
    }
    ACCEPTED
}

fn message_id(value: f32) -> Option<u32> {
    let whole = (0.0..=MESSAGE_MAX).contains(&value) && round(value) == value;
    whole.then_some(value as u32)
}

fn request_message(command: &Command, schedule: &Schedule) -> MavResult {
    match message_id(command.params[0]) {
        Some(AUTOPILOT_VERSION_DATA::ID) => ACCEPTED,
        // It is about another message, which parameter 2 names.
        Some(MESSAGE_INTERVAL_DATA::ID) => match message_id(command.params[1]) {
            Some(id) if u16::try_from(id).is_ok() => ACCEPTED,
            _ => DENIED,
        },
        Some(id) if schedule.find(id).is_some() || ftp::is_metadata(id) => ACCEPTED,
        _ => DENIED,
    }
}

fn requested_message(command: &Command) -> Reply {
    match command.params[0] as u32 {
        MESSAGE_INTERVAL_DATA::ID => Reply::Interval(command.params[1] as u16),
        id => Reply::Message(id),
    }
}

fn set_interval(message: f32, interval_us: f32, schedule: &mut Schedule) -> MavResult {
    let interval = if interval_us == -1.0 {
        Interval::Off
    } else if interval_us == 0.0 {
        Interval::Default
    } else if (1.0..=INTERVAL_MAX_US).contains(&interval_us) {
        Interval::Us(interval_us as u32)
    } else {
        return DENIED;
    };
    match message_id(message).and_then(|id| schedule.find(id)) {
        Some(stream) if schedule.set(stream, interval) => ACCEPTED,
        _ => DENIED,
    }
}
