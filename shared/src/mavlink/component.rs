//! The ESC as others on MAVLink see it.

use crate::mavlink::context::{Act, Context, Request};
use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA, HEARTBEAT_DATA,
    MISSION_REQUEST_LIST_DATA, MavSeverity, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA,
    PARAM_SET_DATA, SETUP_SIGNING_DATA,
};
use siskin_params::{Image, ParamId, Params};
use siskin_throttle::News;

use super::command::{ACCEPTED, Command, Commands, FAILED, IDENTIFY, RUN_PREARM_CHECKS};
use super::faults::Announcer;
use super::frame::Address;
use super::frame::Frame;
use super::identity::{Identity, Role};
use super::pace::Pace;
use super::parameter::{self, List};
use super::reply::{PING, Replies, Reply, Writer};
use super::schedule::{Intervals, Schedule};
use super::signing::{Kept, Signing, Trust};
use super::warnings::{Warning, Warnings};
use super::{ftp, news};
use crate::drive::Faults;

mod send;

const PING_ID: u32 = PING.0;

/// One ESC on MAVLink. Frames may come from several links; its own go to all of them.
#[derive(Clone, Debug)]
pub struct Component {
    identity: Identity,
    writer: Writer,
    replies: Replies,
    list: List,
    list_pace: Pace,
    schedule: Schedule,
    commands: Commands,
    /// True if it has announced itself.
    started: bool,
    params_changed: bool,
    /// True if something stored has changed.
    keep: bool,
    /// True if the key is to go once the replies have been sent.
    unsign: bool,
    announcer: Announcer,
    /// As of the last poll.
    faults: Faults,
    failed_starts: u8,
    /// When the motor last turned, or was not to.
    stands_since_us: u64,
    infos: u16,
    telemetries: u16,
    image: Image,
    warnings: Warnings,
    files: ftp::Server,
}

impl Component {
    /// Creates a component with the identity in `params`; a change of it applies at the next start.
    ///
    /// `link_bytes_per_s` is the rate of the slowest link (11520 at 115200 baud). Parameter lists
    /// take at most half of it, and streams the other half; replies are never delayed.
    ///
    /// Never inlined: a copy of it takes 1.7 KB of stack.
    #[inline(never)]
    pub fn new(params: &Params, image: &Image, link_bytes_per_s: u32) -> Self {
        let identity = Identity::new(params);
        Self {
            writer: Writer::new(identity.address),
            // Constants are built in place; copies would take 1.6 KB of stack.
            replies: const { Replies::new() },
            list: List::default(),
            list_pace: Pace::new(link_bytes_per_s / 2),
            schedule: Schedule::new(identity.place, link_bytes_per_s / 2),
            commands: Commands::new(&identity),
            identity,
            started: false,
            params_changed: false,
            keep: false,
            unsign: false,
            announcer: Announcer::new(),
            faults: Faults::NONE,
            failed_starts: 0,
            stands_since_us: 0,
            infos: 0,
            telemetries: 0,
            image: *image,
            warnings: const { Warnings::new() },
            files: ftp::Server::default(),
        }
    }

    /// Obeys a frame. Replies leave at the next [`Component::poll`]; up to 40 wait, and a text
    /// reports any that found no room.
    ///
    /// Never inlined, like [`Component::poll`]: an image report shows its size.
    #[inline(never)]
    pub fn handle(&mut self, frame: &Frame, context: &mut Context) {
        if frame.from == self.identity.address {
            return;
        }
        if frame.id == HEARTBEAT_DATA::ID {
            self.commands.heartbeat(context.now_us, frame.from);
        }
        let target = target(frame).filter(|target| self.identity.is_for(*target));
        // Frames between others are not tracked.
        if target.is_none() && !self.identity.awaits(frame) {
            return;
        }
        let signing = &mut self.writer.sender.signing;
        signing.advance(context.now_us);
        let trust = signing.judge(frame);
        let Some(target) = target else {
            if trust == Trust::Full {
                self.identity.belong_to(frame.from);
                self.writer.sender.send_as(self.identity.address);
            }
            return;
        };
        if trust == Trust::None {
            return;
        }
        // If nobody else was addressed, an unknown name is an error.
        let alone = target.component != 0 || self.identity.role == Role::Standalone;
        let drive = context.drive();
        let mut command = None;
        match frame.id {
            PING_ID if target.system == 0 && target.component == 0 => {
                self.replies.push(Reply::Pong {
                    to: frame.from,
                    asked: frame.bytes(0),
                });
            }
            PARAM_REQUEST_LIST_DATA::ID => self.list.start(),
            PARAM_REQUEST_READ_DATA::ID => parameter::read(frame, alone, &mut self.replies),
            PARAM_SET_DATA::ID => {
                let taken = parameter::set(
                    frame,
                    trust,
                    alone,
                    drive.stopped,
                    context,
                    &mut self.replies,
                );
                self.keep |= taken.is_some();
                match taken {
                    Some(ParamId::MotIdentify) => {
                        command = Some(Command::identify(context.now_us, frame));
                    }
                    _ => self.params_changed |= taken.is_some(),
                }
            }
            COMMAND_LONG_DATA::ID | COMMAND_INT_DATA::ID => {
                let exact = target == self.identity.address;
                command = Some(Command::read(context.now_us, frame, trust, exact));
            }
            SETUP_SIGNING_DATA::ID if trust == Trust::Full => self.set_up_signing(frame),
            MISSION_REQUEST_LIST_DATA::ID if self.identity.role == Role::Standalone => {
                self.replies.push(Reply::MissionCount {
                    to: frame.from,
                    mission_type: frame.u8(2),
                });
            }
            FILE_TRANSFER_PROTOCOL_DATA::ID => {
                let view = ftp::View {
                    params: context.params,
                    board: context.board,
                    telemetry: context.telemetry,
                    check: context.check,
                    identification: context.identification,
                    record: context.record,
                    warning: self.warnings.last(),
                };
                if let Some(answer) = self.files.handle(context.now_us, frame, &view) {
                    self.replies.push(Reply::Ftp {
                        to: frame.from,
                        answer,
                    });
                }
            }
            _ => {}
        }
        if let Some(command) = command {
            let (schedule, replies) = (&mut self.schedule, &mut self.replies);
            self.commands
                .handle(&command, drive, context, schedule, replies);
        }
    }

    fn set_up_signing(&mut self, frame: &Frame) {
        let signing = &mut self.writer.sender.signing;
        let is_time = signing.set_up(frame.bytes(10), frame.u64(0));
        let (severity, text) = if !is_time {
            let text = "Signing refused: bad time";
            (MavSeverity::MAV_SEVERITY_WARNING, text)
        } else if signing.signs() {
            let text = "Signing: changes need the key";
            (MavSeverity::MAV_SEVERITY_NOTICE, text)
        } else {
            (MavSeverity::MAV_SEVERITY_NOTICE, "Signing: off")
        };
        self.keep |= is_time;
        self.unsign &= !is_time;
        self.replies.text(severity, text);
    }

    /// Restores the key and the signature time stored before the start.
    pub fn keep_signing(&mut self, kept: Option<Kept>) {
        self.writer.sender.signing = Signing::new(kept);
    }

    /// Returns the key and the signature time, to be stored.
    pub fn kept_signing(&self) -> Option<Kept> {
        self.writer.sender.signing.kept().filter(|_| !self.unsign)
    }

    /// Forgets the key, once the pending replies have been signed with it.
    pub fn forget_signing(&mut self) {
        self.unsign = true;
    }

    /// Restores the stored message intervals.
    pub fn keep_intervals(&mut self, intervals: &Intervals) {
        self.schedule.keep(intervals);
    }

    /// Returns the message intervals, to be stored.
    pub fn kept_intervals(&self) -> Intervals {
        self.schedule.intervals()
    }

    /// Returns true if something stored has changed since the last call.
    pub fn take_changed(&mut self) -> bool {
        core::mem::take(&mut self.keep) | self.commands.take_left()
    }

    /// Returns the next thing for the caller to do; ask after each poll until there is none.
    pub fn take_request(&mut self) -> Option<Request> {
        if core::mem::take(&mut self.params_changed) {
            return Some(Request::ParamsChanged);
        }
        self.commands.take_request(self.replies.is_empty())
    }

    /// Returns the next thing for the ESC to do, likewise.
    pub fn take_act(&mut self) -> Option<Act> {
        self.commands.take_act()
    }

    /// Returns true if the command waiting for storage asks for nothing else.
    pub fn stores_all(&self) -> bool {
        self.commands.stores_all()
    }

    /// Returns the number of its motor in the vehicle, from 0, if its component id numbers it.
    #[cfg(feature = "group")]
    pub fn number(&self) -> Option<u8> {
        self.identity.number()
    }

    /// Leaves the messages for four ESCs to another one.
    #[cfg(feature = "group")]
    pub fn follow(&mut self) {
        self.schedule.follow();
    }

    /// Returns true if it leaves them to another.
    #[cfg(feature = "group")]
    pub fn follows(&self) -> bool {
        self.schedule.follows()
    }

    /// Completes a storage request: `Ok` if the values now survive a loss of power, or a few words
    /// on why not. The command is acknowledged with this.
    pub fn storage_done(&mut self, result: Result<(), &'static str>) {
        if self.commands.storage_done(result, &mut self.replies) {
            self.list.start();
        }
    }

    /// Reports parameters that something other than MAVLink has changed: clients are told, and
    /// [`Request::ParamsChanged`] follows.
    pub fn changed(&mut self, ids: &[ParamId]) {
        for id in ids {
            self.replies.value(*id);
        }
        self.params_changed = true;
    }

    /// Like [`Component::changed`], for a value that does not affect the configuration.
    pub fn report_value(&mut self, id: ParamId) {
        self.replies.value(id);
    }

    /// Reports the throttle wire's news.
    pub fn report_news(&mut self, news: News) {
        if let News::Calibration(step) = news {
            self.commands.follow_stick(step, &mut self.replies);
        }
        if let Some((severity, text)) = news::words(news) {
            self.replies.push(Reply::Text(severity, text));
        }
    }

    /// Reports a self-test's progress, percent.
    pub fn report_progress(&mut self, percent: u8) {
        self.commands.check_progress(percent, &mut self.replies);
    }

    /// Reports that an identification has reached this step.
    pub fn report_step(&mut self, step: &'static str) {
        let text = ["Identification: ", step];
        self.replies
            .push(Reply::Text(MavSeverity::MAV_SEVERITY_INFO, text));
    }

    /// Reports the end of a self-test, and acknowledges the command for it, if any.
    pub fn check_done(&mut self, passed: bool) {
        self.measured(RUN_PREARM_CHECKS, passed);
    }

    /// Reports the end of an identification, or of keeping its results, likewise.
    pub fn identification_done(&mut self, succeeded: bool) {
        self.measured(IDENTIFY, succeeded);
    }

    fn measured(&mut self, command: u16, succeeded: bool) {
        let result = if succeeded { ACCEPTED } else { FAILED };
        self.commands.end(command, result, &mut self.replies);
    }

    /// Warns the user at the next poll. Two can wait; of more, the first are kept.
    pub fn warn(&mut self, warning: Warning) {
        self.warnings.push(warning);
    }

    /// Reports the outcome of a storage request that did not come by MAVLink.
    pub fn report_stored(&mut self, result: Result<(), &'static str>) {
        let (severity, text) = match result {
            Ok(()) => (MavSeverity::MAV_SEVERITY_INFO, "Parameters stored"),
            Err(reason) => (MavSeverity::MAV_SEVERITY_ERROR, reason),
        };
        let result = if result.is_ok() { ACCEPTED } else { FAILED };
        self.commands.end_calibration(result, &mut self.replies);
        self.replies.text(severity, text);
    }
}

/// Returns the target of a frame, by its place in each message that is obeyed.
fn target(frame: &Frame) -> Option<Address> {
    let offset = match frame.id {
        PARAM_REQUEST_LIST_DATA::ID | MISSION_REQUEST_LIST_DATA::ID => 0,
        FILE_TRANSFER_PROTOCOL_DATA::ID => 1,
        PARAM_REQUEST_READ_DATA::ID => 2,
        PARAM_SET_DATA::ID => 4,
        SETUP_SIGNING_DATA::ID => 8,
        PING_ID => 12,
        COMMAND_LONG_DATA::ID | COMMAND_INT_DATA::ID => 30,
        _ => return None,
    };
    Some(frame.address(offset))
}
