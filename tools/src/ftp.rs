//! Reads the ESC's files by MAVLink FTP.

use mavlink::dialects::ardupilotmega::FILE_TRANSFER_PROTOCOL_DATA;

use crate::error::Error;
use crate::message::Message;
use crate::session::Session;

const RESET_SESSIONS: u8 = 2;
const OPEN_FILE_RO: u8 = 4;
const READ_FILE: u8 = 5;
const ACK: u8 = 128;

/// Refusals (MAVLink FTP error codes): another client has a file open, and end of file.
const NO_SESSIONS_AVAILABLE: u8 = 5;
const END_OF_FILE: u8 = 6;

/// Bytes of a message ahead of its data.
const HEADER: usize = 12;
/// Bytes per request: as many as a message holds.
const PIECE: usize = 239;

/// The most that a file may have: several times the longest that is read, the fault record, and half a minute at 57600
/// baud.
const FILE_MAX: usize = 64 * 1024;
/// The most requests for it: an ESC may send less than a whole piece, but not forever.
const PIECES_MAX: usize = 1024;

/// Reads a text; what a terminal would take for more than text becomes `?`.
///
/// # Errors
/// Those of [`read`].
pub(crate) fn read_text(session: &mut Session, path: &str) -> Result<String, Error> {
    let file = read(session, path)?;
    let plain = |byte: u8| match byte {
        b'\n' | b' ' => char::from(byte),
        _ if byte.is_ascii_graphic() => char::from(byte),
        _ => '?',
    };
    Ok(file.into_iter().map(plain).collect())
}

/// Reads a whole file.
///
/// # Errors
/// [`Error::Refused`] if the ESC has no such file or does not come to its end, [`Error::NoAnswer`] if it is silent.
pub(crate) fn read(session: &mut Session, path: &str) -> Result<Vec<u8>, Error> {
    let mut sequence = 0;
    let mut request = |opcode, offset: usize, data: &[u8], size| {
        sequence += 1;
        ask(session, path, (sequence, opcode), (offset, data, size))
    };
    let refused = |number| {
        Error::Refused {
        what: path.into(),
        reason: match number {
            NO_SESSIONS_AVAILABLE => "another program is reading one of its files; try again in 10 s",
            _ => "this component does not have it: its image is older than this program, or has no room for it",
        }
        .into(),
    }
    };
    // A session that an earlier run of this program left open would be in the way.
    request(RESET_SESSIONS, 0, &[], 0)?.map_err(refused)?;
    request(OPEN_FILE_RO, 0, path.as_bytes(), path.len())?.map_err(refused)?;
    let mut file = Vec::new();
    for _ in 0..PIECES_MAX {
        if file.len() > FILE_MAX {
            break;
        }
        match request(READ_FILE, file.len(), &[], PIECE)? {
            Ok(piece) if !piece.is_empty() => file.extend(piece),
            Ok(_) | Err(END_OF_FILE) => return Ok(file),
            Err(number) => {
                return Err(Error::Refused {
                    what: path.into(),
                    reason: format!("it changed while it was read (error {number}); try again"),
                });
            }
        }
    }
    Err(Error::Refused {
        what: path.into(),
        reason: format!(
            "no end after {} bytes; is this a Siskin ESC? Name another with --component",
            file.len()
        ),
    })
}

/// Sends one request; returns the data of the answer, or the number of the refusal.
fn ask(
    session: &mut Session,
    path: &str,
    (sequence, opcode): (u16, u8),
    (offset, data, size): (usize, &[u8], usize),
) -> Result<Result<Vec<u8>, u8>, Error> {
    let target = session.target();
    let mut payload = [0; 251];
    payload[..2].copy_from_slice(&sequence.to_le_bytes());
    payload[3] = opcode;
    payload[4] = u8::try_from(size).unwrap_or(u8::MAX);
    payload[8..HEADER].copy_from_slice(&u32::try_from(offset).unwrap_or(u32::MAX).to_le_bytes());
    payload[HEADER..][..data.len()].copy_from_slice(data);
    let answers = |message| match message {
        Message::File(answer) => {
            let of = (answer[5], u16::from_le_bytes([answer[0], answer[1]]));
            (of == (opcode, sequence.wrapping_add(1))).then_some(answer)
        }
        _ => None,
    };
    let answer = session.ask(
        path,
        || FILE_TRANSFER_PROTOCOL_DATA {
            target_network: 0,
            target_system: target.system,
            target_component: target.component,
            payload,
        },
        answers,
    )?;
    let len = usize::from(answer[4]).min(answer.len() - HEADER);
    let data = &answer[HEADER..][..len];
    Ok(if answer[3] == ACK {
        Ok(data.to_vec())
    } else {
        Err(data.first().copied().unwrap_or(0))
    })
}
