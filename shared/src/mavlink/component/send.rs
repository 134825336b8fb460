//! Sends what leaves the component, in this order: faults, answers, warnings, streams, the rest.

use mavlink::MessageData;
use mavlink::dialects::ardupilotmega::{
    AUTOPILOT_VERSION_DATA, ESC_INFO_DATA, ESC_STATUS_DATA, FILE_TRANSFER_PROTOCOL_DATA,
    HEARTBEAT_DATA, MESSAGE_INTERVAL_DATA, MavParamError, MavSeverity, NAMED_VALUE_FLOAT_DATA,
    PARAM_VALUE_DATA,
};
use siskin_params::{ParamId, Params};

use super::{Component, Context};
use crate::image::VERSION_TEXT;
use crate::mavlink::faults::FaultEvent;
use crate::mavlink::frame::Address;
use crate::mavlink::group::Escs;
use crate::mavlink::payload::{Payload, id_of};
use crate::mavlink::reply::Reply;
use crate::mavlink::schedule::{self, Stream};
use crate::mavlink::{check, ftp, messages, parameter};
use crate::telemetry::SIGNALS;

/// FILE_TRANSFER_PROTOCOL.
const FILE: (u32, u8) = id_of::<FILE_TRANSFER_PROTOCOL_DATA>();

/// Time after which a motor that is asked to turn and does not is reported, and again, µs.
const STANDS_US: u64 = 3_000_000;

impl Component {
    /// Sends all that is pending or due, one call of `send` per frame. Call it every millisecond or so.
    ///
    /// Never inlined: its stack is free for what the caller does next.
    #[inline(never)]
    pub fn poll(&mut self, context: &mut Context, send: &mut dyn FnMut(&[u8])) {
        self.writer.sender.signing.advance(context.now_us);
        self.files.rest();
        self.commands.poll(context.now_us);
        self.report_faults(context, send);
        if !core::mem::replace(&mut self.started, true) {
            let text = ["Siskin ESC ", VERSION_TEXT, ", ", self.image.board];
            self.text(MavSeverity::MAV_SEVERITY_INFO, &text, send);
        }
        while let Some(reply) = self.replies.next() {
            self.send_reply(reply, context, send);
        }
        if core::mem::take(&mut self.unsign) {
            self.keep_signing(None);
        }
        if self.replies.take_overrun() {
            self.text(
                MavSeverity::MAV_SEVERITY_WARNING,
                &["MAVLink: too many requests"],
                send,
            );
        }
        while let Some(warning) = self.warnings.next() {
            self.text(MavSeverity::MAV_SEVERITY_WARNING, &[&warning], send);
        }
        while let Some(id) = self.replies.next_value() {
            self.send_value(context, id, send);
        }
        let overhead_len = self.writer.sender.overhead_len();
        while let Some(stream) =
            self.schedule
                .next_due(context.now_us, context.params, overhead_len)
        {
            self.send_stream(stream, context, send);
        }
        while !self.list.is_empty()
            && self
                .list_pace
                .take(context.now_us, overhead_len + PARAM_VALUE_DATA::ENCODED_LEN)
        {
            if let Some(id) = self.list.next() {
                self.send_value(context, id, send);
            }
        }
        self.send_burst(context, send);
    }

    /// Reports faults in words, and by an immediate ESC_INFO, whose flags would otherwise be up to a second late.
    fn report_faults(&mut self, context: &mut Context, send: &mut dyn FnMut(&[u8])) {
        let faults = context.telemetry.faults;
        if core::mem::replace(&mut self.faults, faults) != faults {
            self.schedule.hasten(Stream::EscInfo);
        }
        while let Some(news) = self.announcer.next(context.now_us, faults) {
            let (severity, word, fault) = match news {
                FaultEvent::Began(fault) => (MavSeverity::MAV_SEVERITY_CRITICAL, "Fault: ", fault),
                FaultEvent::Ended(fault) => {
                    (MavSeverity::MAV_SEVERITY_NOTICE, "Fault ended: ", fault)
                }
            };
            self.text(severity, &[word, fault.text()], send);
        }
        // Until the last attempt, which is a fault, nothing else says why the motor does not turn.
        let failed = context.telemetry.failed_starts;
        let before = core::mem::replace(&mut self.failed_starts, failed);
        if failed != before && failed != 0 && faults.is_empty() {
            let text = "Start failed: retrying";
            self.text(MavSeverity::MAV_SEVERITY_WARNING, &[text], send);
        }
        self.report_standing(context, send);
    }

    /// Says so where throttle does not turn the motor, whatever the reason.
    fn report_standing(&mut self, context: &mut Context, send: &mut dyn FnMut(&[u8])) {
        let rests = context.authority.command().rests();
        if rests || context.telemetry.turns() || !context.telemetry.faults.is_empty() {
            self.stands_since_us = context.now_us;
        } else if context.now_us - self.stands_since_us >= STANDS_US {
            self.stands_since_us = context.now_us;
            let text = "Motor does not turn";
            self.text(MavSeverity::MAV_SEVERITY_WARNING, &[text], send);
        }
    }

    fn send_reply(&mut self, reply: Reply, context: &mut Context, send: &mut dyn FnMut(&[u8])) {
        let writer = &mut self.writer;
        match reply {
            Reply::Ack {
                to,
                command,
                result,
                progress,
            } => writer.ack(to, command, (result, progress), send),
            Reply::Message(AUTOPILOT_VERSION_DATA::ID) => {
                let mut payload = Payload::new();
                messages::autopilot_version(&mut payload, &self.image);
                let message = id_of::<AUTOPILOT_VERSION_DATA>();
                writer.sender.send_payload(message, payload.bytes(), send);
            }
            Reply::Message(id) => {
                if let Some(stream) = self.schedule.find(id) {
                    self.send_stream(stream, context, send);
                } else {
                    self.send_metadata(id, context.now_us, send);
                }
            }
            Reply::Interval(message) => self.send_interval(message, context.params, send),
            Reply::Pong { to, asked } => writer.pong(to, &asked, send),
            Reply::MissionCount { to, mission_type } => {
                writer.mission_count(to, mission_type, send);
            }
            Reply::UnknownParam { to, name, index } => {
                let error = MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST;
                writer.param_error(to, (name, index), error, send);
            }
            Reply::Refused { to, id, refusal } => {
                let place = (messages::name_bytes(id), parameter::BY_NAME);
                writer.param_error(to, place, refusal.error, send);
                let (other, colon) = refusal.because.map_or(("", ""), |b| (b.entry().name, ": "));
                let pieces = [id.entry().name, " refused: ", other, colon, refusal.reason];
                writer.text(MavSeverity::MAV_SEVERITY_WARNING, &pieces, send);
            }
            Reply::Text(severity, text) => writer.text(severity, &text, send),
            Reply::Ftp { to, ref answer } => self.send_file(to, answer, context, send),
        }
    }

    fn send_stream(&mut self, stream: Stream, context: &mut Context, send: &mut dyn FnMut(&[u8])) {
        let place = self.identity.place;
        let telemetry = context.telemetry;
        let escs = Escs::of(place, telemetry, context.four());
        let mut payload = Payload::new();
        let message = match stream {
            Stream::Heartbeat => {
                let armed = context.authority.armed();
                let stopped = context.drive().stopped;
                messages::heartbeat(&mut payload, &self.identity, telemetry, armed, stopped);
                id_of::<HEARTBEAT_DATA>()
            }
            Stream::EscInfo => {
                self.infos = self.infos.wrapping_add(1);
                messages::esc_info(&mut payload, context.now_us, &escs, self.infos);
                id_of::<ESC_INFO_DATA>()
            }
            Stream::BadFrames => {
                let share = telemetry.bad_share * 100.0;
                return self.send_named(context.now_us, "bad_frames", share, send);
            }
            Stream::Signals => {
                let mut chosen = schedule::signals(context.params);
                for (name, value) in SIGNALS.iter().zip(&telemetry.signals) {
                    if chosen & 1 != 0 {
                        self.send_named(context.now_us, name, *value, send);
                    }
                    chosen >>= 1;
                }
                return;
            }
            Stream::EscStatus => {
                messages::esc_status(&mut payload, context.now_us, &escs);
                id_of::<ESC_STATUS_DATA>()
            }
            Stream::EscTelemetry => {
                self.telemetries = self.telemetries.wrapping_add(1);
                messages::esc_telemetry(&mut payload, &escs, self.telemetries);
                place.telemetry()
            }
        };
        self.send_payload(message, &payload, send);
    }

    fn send_named(&mut self, now_us: u64, name: &str, value: f32, send: &mut dyn FnMut(&[u8])) {
        let mut payload = Payload::new();
        messages::named_value(&mut payload, now_us, name, value);
        self.send_payload(id_of::<NAMED_VALUE_FLOAT_DATA>(), &payload, send);
    }

    fn send_payload(&mut self, message: (u32, u8), payload: &Payload, send: &mut dyn FnMut(&[u8])) {
        let sender = &mut self.writer.sender;
        sender.send_payload(message, payload.bytes(), send);
    }

    /// Sends MESSAGE_INTERVAL: -1 if the stream is off, 0 if there is none.
    fn send_interval(&mut self, message: u16, params: &Params, send: &mut dyn FnMut(&[u8])) {
        let interval_us = match self.schedule.find(u32::from(message)) {
            Some(stream) => self
                .schedule
                .interval_us(stream, params)
                .map_or(-1, |us| i32::try_from(us).unwrap_or(i32::MAX)),
            None => 0,
        };
        let mut payload = Payload::new();
        payload.u32(interval_us as u32);
        payload.u16(message);
        self.send_payload(id_of::<MESSAGE_INTERVAL_DATA>(), &payload, send);
    }

    /// Sends as much of the file being read as the link has room for. Never inlined, nor are those below: their stack
    /// is free for the rest of what is sent.
    #[inline(never)]
    fn send_burst(&mut self, context: &Context, send: &mut dyn FnMut(&[u8])) {
        let overhead_len = self.writer.sender.overhead_len();
        while let Some(len) = self.files.burst_payload_len()
            && self.list_pace.take(context.now_us, overhead_len + len)
        {
            if let Some((to, answer)) = self.files.next_of_burst(context.now_us) {
                self.send_file(to, &answer, context, send);
            }
        }
    }

    #[inline(never)] // as above
    fn send_file(
        &mut self,
        to: Address,
        answer: &ftp::Answer,
        context: &Context,
        send: &mut dyn FnMut(&[u8]),
    ) {
        let view = ftp::View {
            params: context.params,
            board: context.board,
            telemetry: context.telemetry,
            check: context.check,
            identification: context.identification,
            record: context.record,
            warning: self.warnings.last(),
        };
        let mut payload = [0; ftp::PAYLOAD_MAX];
        answer.write(to, &mut self.files, &view, &mut payload);
        let sender = &mut self.writer.sender;
        sender.send_payload(FILE, &payload, send);
    }

    #[inline(never)] // as above
    fn send_metadata(&mut self, id: u32, now_us: u64, send: &mut dyn FnMut(&[u8])) {
        let message = (id, check::extra_crc(id));
        let payload = ftp::metadata(id, now_us);
        let sender = &mut self.writer.sender;
        sender.send_payload(message, &payload, send);
    }

    fn send_value(&mut self, context: &Context, id: ParamId, send: &mut dyn FnMut(&[u8])) {
        let mut payload = Payload::new();
        messages::param_value(&mut payload, context.params, id);
        self.send_payload(id_of::<PARAM_VALUE_DATA>(), &payload, send);
    }

    fn text(&mut self, severity: MavSeverity, pieces: &[&str], send: &mut dyn FnMut(&[u8])) {
        self.writer.text(severity, pieces, send);
    }
}
