//! The messages from an ESC that this program reads.

use mavlink::dialects::ardupilotmega::{
    COMMAND_ACK_DATA, ESC_INFO_DATA, ESC_STATUS_DATA, ESC_TELEMETRY_1_TO_4_DATA,
    ESC_TELEMETRY_5_TO_8_DATA, ESC_TELEMETRY_9_TO_12_DATA, ESC_TELEMETRY_13_TO_16_DATA,
    FILE_TRANSFER_PROTOCOL_DATA, HEARTBEAT_DATA, MavAutopilot, MavCmd, MavResult, MavSeverity,
    MavType, NAMED_VALUE_FLOAT_DATA, PARAM_ERROR_DATA, PARAM_VALUE_DATA, STATUSTEXT_DATA,
};
use mavlink::types::CharArray;
use mavlink::{MavlinkVersion, MessageData};
use siskin_control::mavlink::Address;

/// Spells out an address.
pub(crate) fn name_of(address: Address) -> String {
    format!("system {} component {}", address.system, address.component)
}

/// A message with its sender.
#[derive(Clone, Debug)]
pub(crate) struct Incoming {
    pub(crate) from: Address,
    pub(crate) message: Message,
    /// The whole frame of a heartbeat, which shows whether the sender signs; empty for others.
    pub(crate) raw: Vec<u8>,
}

/// The messages that this program uses.
#[derive(Clone, Debug)]
pub(crate) enum Message {
    Heartbeat(Heartbeat),
    ParamValue(PARAM_VALUE_DATA),
    ParamError(PARAM_ERROR_DATA),
    CommandAck(Ack),
    StatusText(StatusText),
    EscInfo(ESC_INFO_DATA),
    EscStatus(ESC_STATUS_DATA),
    EscTelemetry(EscTelemetry),
    Named(NAMED_VALUE_FLOAT_DATA),
    /// A MAVLink FTP answer, unparsed.
    File([u8; 251]),
}

/// What has become of a command so far.
#[derive(Clone, Debug)]
pub(crate) struct Ack {
    pub(crate) command: MavCmd,
    pub(crate) result: MavResult,
    /// How far a command in progress is, percent.
    pub(crate) percent: u8,
}

impl Ack {
    fn read(payload: &[u8]) -> Option<Self> {
        let data = COMMAND_ACK_DATA::deser(MavlinkVersion::V2, payload).ok()?;
        Some(Self {
            command: data.command,
            result: data.result,
            // An extension field, which the generated type lacks.
            percent: payload.get(3).copied().unwrap_or(0),
        })
    }
}

/// One of the `ESC_TELEMETRY_*` messages, which share a layout.
#[derive(Clone, Debug)]
pub(crate) struct EscTelemetry {
    /// Number of its first ESC, from 0.
    pub(crate) index: u8,
    pub(crate) data: ESC_TELEMETRY_1_TO_4_DATA,
}

/// The two fields of a heartbeat that tell an ESC from other components. They are raw because the typed
/// message rejects vehicle types that it does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Heartbeat {
    /// `MAV_TYPE`.
    pub(crate) kind: u8,
    /// `MAV_AUTOPILOT`.
    pub(crate) autopilot: u8,
}

impl Heartbeat {
    /// Returns whether an ESC may introduce itself like this: as a vehicle of its own, or beside an
    /// autopilot.
    pub(crate) fn may_be_esc(self) -> bool {
        let standalone = self.kind == MavType::MAV_TYPE_GENERIC as u8
            && self.autopilot == MavAutopilot::MAV_AUTOPILOT_GENERIC as u8;
        standalone || self.kind == MavType::MAV_TYPE_SERVO as u8
    }
}

/// A text for people, or a piece of one.
#[derive(Clone, Debug)]
pub(crate) struct StatusText {
    pub(crate) severity: MavSeverity,
    pub(crate) text: String,
    /// Number shared by the pieces of a text; 0 for a text in one piece.
    id: u16,
    /// Number of the piece, from 0.
    piece: u8,
    /// Whether this is the last piece: its text ends before the field does.
    last: bool,
}

impl StatusText {
    fn read(payload: &[u8]) -> Option<Self> {
        let data = STATUSTEXT_DATA::deser(MavlinkVersion::V2, payload).ok()?;
        // The extension fields follow it; the generated type lacks them.
        let byte = |offset| {
            payload
                .get(STATUSTEXT_DATA::ENCODED_LEN + offset)
                .copied()
                .unwrap_or(0)
        };
        let id = u16::from_le_bytes([byte(0), byte(1)]);
        Some(Self {
            severity: data.severity,
            text: text(&data.text),
            id,
            piece: byte(2),
            last: id == 0 || data.text.contains(&0),
        })
    }
}

/// Texts longer than one message, while their pieces arrive.
#[derive(Debug, Default)]
pub(crate) struct Texts {
    open: Vec<(Address, StatusText)>,
}

impl Texts {
    /// Texts that may be open at once; the oldest gives way.
    const OPEN_MAX: usize = 8;

    /// Takes a piece, and returns the whole text after its last one. A lost piece leaves `...`.
    pub(crate) fn join(&mut self, from: Address, next: StatusText) -> Option<StatusText> {
        if next.id == 0 {
            return Some(next);
        }
        let position = self
            .open
            .iter()
            .position(|(of, text)| *of == from && text.id == next.id);
        let mut whole = match position {
            Some(position) => {
                let (_, mut whole) = self.open.remove(position);
                if next.piece != whole.piece.wrapping_add(1) {
                    whole.text += "...";
                }
                whole.text += &next.text;
                whole.piece = next.piece;
                whole
            }
            None if next.piece > 0 => StatusText {
                text: format!("...{}", next.text),
                ..next
            },
            None => next.clone(),
        };
        whole.last = next.last;
        if whole.last {
            return Some(whole);
        }
        if self.open.len() == Self::OPEN_MAX {
            self.open.remove(0);
        }
        self.open.push((from, whole));
        None
    }
}

impl Message {
    /// Parses a payload; `None` if this program does not use or cannot parse it.
    pub(crate) fn read(id: u32, payload: &[u8]) -> Option<Self> {
        // The versions differ only in extension fields, which these types do not have.
        fn typed<D: MessageData>(payload: &[u8]) -> Option<D> {
            D::deser(MavlinkVersion::V2, payload).ok()
        }
        let telemetry = |index| {
            let data = typed(payload)?;
            Some(Self::EscTelemetry(EscTelemetry { index, data }))
        };
        match id {
            HEARTBEAT_DATA::ID => Some(Self::Heartbeat(Heartbeat {
                // Trailing zero bytes are not sent.
                kind: payload.get(4).copied().unwrap_or(0),
                autopilot: payload.get(5).copied().unwrap_or(0),
            })),
            PARAM_VALUE_DATA::ID => typed(payload).map(Self::ParamValue),
            PARAM_ERROR_DATA::ID => typed(payload).map(Self::ParamError),
            COMMAND_ACK_DATA::ID => Ack::read(payload).map(Self::CommandAck),
            NAMED_VALUE_FLOAT_DATA::ID => typed(payload).map(Self::Named),
            FILE_TRANSFER_PROTOCOL_DATA::ID => {
                typed(payload).map(|data: FILE_TRANSFER_PROTOCOL_DATA| Self::File(data.payload))
            }
            STATUSTEXT_DATA::ID => StatusText::read(payload).map(Self::StatusText),
            ESC_INFO_DATA::ID => typed(payload).map(Self::EscInfo),
            ESC_STATUS_DATA::ID => typed(payload).map(Self::EscStatus),
            ESC_TELEMETRY_1_TO_4_DATA::ID => telemetry(0),
            ESC_TELEMETRY_5_TO_8_DATA::ID => telemetry(4),
            ESC_TELEMETRY_9_TO_12_DATA::ID => telemetry(8),
            ESC_TELEMETRY_13_TO_16_DATA::ID => telemetry(12),
            _ => None,
        }
    }
}

/// Returns the text of a field, up to its first zero byte or its full length. Bytes other than printable
/// ASCII become `?`: they come from outside and go to a terminal.
pub(crate) fn text<const N: usize>(field: &CharArray<N>) -> String {
    field
        .into_iter()
        .take_while(|byte| **byte != 0)
        .map(|&byte| {
            if byte == b' ' || byte.is_ascii_graphic() {
                char::from(byte)
            } else {
                '?'
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heartbeats_of_an_esc_are_told_from_others() {
        let read = |payload: &[u8]| match Message::read(0, payload) {
            Some(Message::Heartbeat(heartbeat)) => heartbeat.may_be_esc(),
            other => panic!("{other:?}"),
        };
        assert!(
            read(&[0, 0, 0, 0, 0, 0, 0, 3, 3]),
            "generic vehicle, generic autopilot"
        );
        assert!(
            read(&[0, 0, 0, 0, 33, 8, 0, 3, 3]),
            "servo beside an autopilot"
        );
        assert!(!read(&[0, 0, 0, 0, 2, 3, 0, 3, 3]), "quadrotor");
        assert!(!read(&[0, 0, 0, 0, 6, 8, 0, 3, 3]), "ground station");
        assert!(
            !read(&[0, 0, 0, 0, 250, 250, 0, 3, 3]),
            "of a later standard"
        );
    }

    #[test]
    fn pieces_of_a_text_are_joined() {
        let from = Address {
            system: 1,
            component: 1,
        };
        let piece = |text: &str, id: u16, number: u8| {
            let mut payload = vec![4];
            payload.extend(text.bytes().chain(std::iter::repeat(0)).take(50));
            payload.extend(id.to_le_bytes());
            payload.push(number);
            match Message::read(253, &payload) {
                Some(Message::StatusText(text)) => text,
                other => panic!("{other:?}"),
            }
        };
        let fifty = "a".repeat(50);
        let mut texts = Texts::default();
        let mut join = |piece| texts.join(from, piece).map(|whole| whole.text);
        assert_eq!(join(piece("short", 0, 0)), Some("short".into()));
        assert_eq!(join(piece(&fifty, 7, 0)), None);
        assert_eq!(join(piece(&fifty, 8, 0)), None);
        assert_eq!(join(piece(&fifty, 7, 1)), None);
        assert_eq!(join(piece("end", 7, 2)), Some(format!("{fifty}{fifty}end")));
        assert_eq!(join(piece("end", 8, 2)), Some(format!("{fifty}...end")));
        assert_eq!(join(piece("end", 9, 1)), Some("...end".into()));
        for id in 10..=20 {
            assert_eq!(join(piece(&fifty, id, 0)), None);
        }
        assert_eq!(join(piece("", 20, 1)), Some(fifty));
        assert_eq!(texts.open.len(), Texts::OPEN_MAX - 1);
    }

    #[test]
    fn telemetry_of_later_escs_has_its_index() {
        let sent = ESC_TELEMETRY_9_TO_12_DATA {
            totalcurrent: [1, 2, 3, 4],
            ..ESC_TELEMETRY_9_TO_12_DATA::DEFAULT
        };
        let mut payload = [0; ESC_TELEMETRY_9_TO_12_DATA::ENCODED_LEN];
        sent.ser(MavlinkVersion::V2, &mut payload);
        match Message::read(11_032, &payload) {
            Some(Message::EscTelemetry(read)) => {
                assert_eq!((read.index, read.data.totalcurrent), (8, [1, 2, 3, 4]));
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn control_characters_do_not_reach_the_terminal() {
        assert_eq!(text(&CharArray::new(*b"a\x1b[2J\xff z\0hid")), "a?[2J? z");
        assert_eq!(text(&CharArray::new(*b"full")), "full");
    }

    #[test]
    fn payloads_of_any_length_are_read_or_refused() {
        for id in [0, 22, 77, 253, 290, 291, 345, 11030, 99999] {
            for length in 0..=255 {
                let payload = vec![0xFF; length];
                let known = Message::read(id, &payload).is_some();
                assert!(!known || id != 99999, "{length}");
            }
        }
    }
}
