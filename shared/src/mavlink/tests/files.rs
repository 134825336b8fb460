//! A client that reads files, written from the protocol's description.

use mavlink::dialects::ardupilotmega::{COMMAND_LONG_DATA, FILE_TRANSFER_PROTOCOL_DATA};
use siskin_params::TABLE;

use super::*;

mod contents;
mod flood;

const FILE_TRANSFER_PROTOCOL: u32 = 110;
const PACK: &str = "@PARAM/param.pck";

const TERMINATE: u8 = 1;
const RESET: u8 = 2;
const LIST: u8 = 3;
const OPEN: u8 = 4;
const READ: u8 = 5;
const CRC: u8 = 14;
const BURST: u8 = 15;
const ACK: u8 = 128;
const NAK: u8 = 129;

const INVALID_DATA_SIZE: u8 = 3;
const INVALID_SESSION: u8 = 4;
const NO_SESSIONS_AVAILABLE: u8 = 5;
const END_OF_FILE: u8 = 6;
const UNKNOWN_COMMAND: u8 = 7;
const FILE_PROTECTED: u8 = 9;
const FILE_NOT_FOUND: u8 = 10;

/// A request from one of two stations.
#[derive(Clone, Copy)]
struct Ask<'a> {
    from: Address,
    sequence: u16,
    session: u8,
    code: u8,
    size: u8,
    offset: u32,
    path: &'a str,
}

const ASK: Ask = Ask {
    from: STATION,
    sequence: 300,
    session: 5,
    code: 0,
    size: 0,
    offset: 0,
    path: "",
};

/// An answer.
#[derive(Clone, Debug, PartialEq)]
struct Told {
    to: [u8; 2],
    sequence: u16,
    session: u8,
    code: u8,
    request: u8,
    complete: u8,
    offset: u32,
    data: Vec<u8>,
}

impl Told {
    fn number(&self) -> u32 {
        assert_eq!(self.code, ACK, "{self:?}");
        u32::from_le_bytes(self.data[..].try_into().expect("four bytes"))
    }
}

fn path(code: u8, path: &str) -> Ask<'_> {
    Ask {
        code,
        size: path.len() as u8,
        path,
        ..ASK
    }
}

fn read(code: u8, offset: u32, size: u8) -> Ask<'static> {
    Ask {
        code,
        size,
        offset,
        ..ASK
    }
}

/// Returns a request's sender and its message.
fn message(ask: Ask) -> (Address, FILE_TRANSFER_PROTOCOL_DATA) {
    let mut message = FILE_TRANSFER_PROTOCOL_DATA {
        target_system: 1,
        target_component: 1,
        ..FILE_TRANSFER_PROTOCOL_DATA::default()
    };
    message.payload[0..2].copy_from_slice(&ask.sequence.to_le_bytes());
    message.payload[2..5].copy_from_slice(&[ask.session, ask.code, ask.size]);
    message.payload[8..12].copy_from_slice(&ask.offset.to_le_bytes());
    message.payload[12..12 + ask.path.len()].copy_from_slice(ask.path.as_bytes());
    (ask.from, message)
}

fn send(bench: &mut Bench, ask: Ask) {
    let (from, message) = message(ask);
    bench.receive(&encode(from, &message, &[]));
}

fn told(sent: &[Sent]) -> Vec<Told> {
    sent.iter()
        .filter_map(|sent| match &sent.message {
            MavMessage::FILE_TRANSFER_PROTOCOL(message) => {
                let header = &message.payload[..12];
                let data = &message.payload[12..];
                let len = usize::from(header[4]);
                assert!(data[len..].iter().all(|byte| *byte == 0));
                Some(Told {
                    to: [message.target_system, message.target_component],
                    sequence: u16::from_le_bytes([header[0], header[1]]),
                    session: header[2],
                    code: header[3],
                    request: header[5],
                    complete: header[6],
                    offset: u32::from_le_bytes(header[8..].try_into().expect("four")),
                    data: data[..len].to_vec(),
                })
            }
            _ => None,
        })
        .collect()
}

/// Returns the one answer to a request.
fn ask(bench: &mut Bench, ask: Ask) -> Told {
    send(bench, ask);
    let mut told = told(&bench.answers());
    assert_eq!(told.len(), 1, "{told:?}");
    told.remove(0)
}

fn refused(bench: &mut Bench, request: Ask, error: u8) {
    let told = ask(bench, request);
    assert_eq!((told.code, told.request), (NAK, request.code), "{told:?}");
    assert_eq!(told.data, [error], "{told:?}");
    assert_eq!(
        (told.session, told.offset),
        (request.session, request.offset)
    );
}

/// Reads an open file, by requests of this size.
fn rest(bench: &mut Bench, size: u8) -> Vec<u8> {
    let mut file = Vec::new();
    loop {
        let request = read(READ, file.len() as u32, size);
        let told = ask(bench, request);
        if told.code == NAK {
            assert_eq!(told.data, [END_OF_FILE]);
            return file;
        }
        assert_eq!(told.offset, file.len() as u32);
        file.extend_from_slice(&told.data);
    }
}

fn fetch(bench: &mut Bench, name: &str, size: u8) -> Vec<u8> {
    let len = ask(bench, path(OPEN, name)).number();
    let file = rest(bench, size);
    assert_eq!(file.len(), len as usize);
    assert_eq!(ask(bench, path(CRC, name)).number(), crc32(&file));
    assert_eq!(ask(bench, read(TERMINATE, 0, 0)).code, ACK);
    file
}

/// By the polynomial's table, unlike the code under test.
fn crc32(bytes: &[u8]) -> u32 {
    let row = |index: u32| {
        (0..8).fold(index, |c, _| {
            (c >> 1) ^ if c & 1 == 1 { 0xEDB8_8320 } else { 0 }
        })
    };
    bytes.iter().fold(0, |crc, byte| {
        (crc >> 8) ^ row((crc ^ u32::from(*byte)) & 255)
    })
}

#[test]
fn a_file_is_read_to_its_end_by_pieces_of_any_size() {
    let mut bench = Bench::new();
    let whole = fetch(&mut bench, PACK, 239);
    for size in [1, 80, 200] {
        assert_eq!(fetch(&mut bench, PACK, size), whole);
    }
    refused(&mut bench, read(READ, 0, 80), INVALID_SESSION);
    assert_eq!(whole[2..6], [TABLE.len() as u8, 0, TABLE.len() as u8, 0]);
    for name in ["general.json.xz", "/parameter.json.xz", "//general.json.xz"] {
        assert_eq!(fetch(&mut bench, name, 239)[..6], *b"\xFD7zXZ\0");
    }
}

#[test]
fn an_answer_tells_what_it_answers_and_whom() {
    let mut bench = Bench::new();
    let opened = ask(&mut bench, path(OPEN, PACK));
    assert_eq!(
        (opened.to, opened.sequence, opened.session),
        ([255, 190], 301, 5)
    );
    assert_eq!(
        (opened.request, opened.complete, opened.offset),
        (OPEN, 0, 0)
    );
    let sequence = u16::MAX;
    let told = ask(
        &mut bench,
        Ask {
            sequence,
            ..read(READ, 7, 9)
        },
    );
    assert_eq!((told.sequence, told.session, told.request), (0, 5, READ));
    assert_eq!((told.offset, told.data.len()), (7, 9));
}

#[test]
fn a_request_that_is_sent_again_gets_the_same_answer() {
    let mut bench = Bench::new();
    for request in [
        path(CRC, PACK),
        path(LIST, "@PARAM"),
        path(OPEN, PACK),
        read(READ, 239, 239),
        read(READ, 60_000, 239),
        read(TERMINATE, 0, 0),
        read(READ, 0, 1),
        read(RESET, 0, 0),
        path(OPEN, "nothing"),
    ] {
        let first = ask(&mut bench, request);
        assert_eq!(ask(&mut bench, request), first);
        assert_eq!(ask(&mut bench, request), first);
    }
    // The lost answer was the one to opening it, and the client has not begun to read.
    let opened = ask(&mut bench, path(OPEN, PACK));
    assert_eq!(ask(&mut bench, path(OPEN, PACK)), opened);
    assert_eq!(rest(&mut bench, 239).len(), opened.number() as usize);
}

#[test]
fn a_burst_brings_the_file_from_an_offset_to_its_end() {
    let mut bench = Bench::new();
    let whole = fetch(&mut bench, PACK, 239);
    assert_eq!(ask(&mut bench, path(OPEN, PACK)).code, ACK);
    for (offset, size) in [
        (0, 239),
        (0, 80),
        (400, 239),
        (whole.len() - 1, 239),
        (0, 239),
    ] {
        send(&mut bench, read(BURST, offset as u32, size));
        let told = told(&bench.run_ms(100));
        let mut file = Vec::new();
        for (i, told) in told.iter().enumerate() {
            assert_eq!(told.sequence, 301 + i as u16);
            assert_eq!((told.code, told.request, told.session), (ACK, BURST, 5));
            assert_eq!(told.offset as usize, offset + file.len());
            file.extend_from_slice(&told.data);
            let ended = offset + file.len() == whole.len();
            assert_eq!(told.complete, u8::from(ended));
            assert!(ended || told.data.len() == usize::from(size));
        }
        assert_eq!(file, whole[offset..]);
    }
    refused(
        &mut bench,
        read(BURST, whole.len() as u32, 239),
        END_OF_FILE,
    );
    refused(&mut bench, read(BURST, u32::MAX, 239), END_OF_FILE);
    assert_eq!(told(&bench.run_ms(100)), []);
}

#[test]
fn a_burst_that_is_asked_for_again_begins_where_that_says() {
    let mut bench = Bench::with(Params::default(), 11_520);
    let len = ask(&mut bench, path(OPEN, PACK)).number();
    send(&mut bench, read(BURST, 0, 100));
    assert!(told(&bench.run_ms(20)).len() < 5);
    send(&mut bench, read(BURST, 300, 100));
    let told = told(&bench.run_ms(1000));
    assert_eq!((told[0].sequence, told[0].offset), (301, 300));
    let sum: usize = told.iter().map(|told| told.data.len()).sum();
    assert_eq!(sum, len as usize - 300);
}

#[test]
fn a_burst_takes_half_of_the_link_and_holds_up_no_answer() {
    let mut bench = Bench::with(Params::default(), 11_520);
    ask(&mut bench, path(OPEN, "parameter.json.xz"));
    send(&mut bench, read(BURST, 0, 239));
    let mut bytes = 0;
    for _ in 0..8 {
        let sent = bench.run_ms(50);
        let of_burst = sent
            .iter()
            .filter(|s| s.message.message_id() == FILE_TRANSFER_PROTOCOL);
        bytes += of_burst.map(|sent| sent.len).sum::<usize>();
        let command = COMMAND_LONG_DATA {
            target_system: 1,
            target_component: 1,
            ..COMMAND_LONG_DATA::default()
        };
        assert_eq!(count(&bench.ask(&command), 77), 1);
    }
    // 0.4 s of 5760 bytes/s, plus what could leave at once.
    assert!((2304 - 266..=2304 + 480).contains(&bytes), "{bytes}");
}

#[test]
fn one_reads_at_a_time_and_the_next_waits_until_he_is_silent() {
    let mut bench = Bench::new();
    let from = Address {
        system: 254,
        component: 1,
    };
    let other = |ask| Ask { from, ..ask };
    assert_eq!(ask(&mut bench, path(OPEN, PACK)).code, ACK);
    for _ in 0..3 {
        bench.run_ms(9000);
        assert_eq!(ask(&mut bench, read(READ, 0, 80)).code, ACK);
        refused(&mut bench, other(path(OPEN, PACK)), NO_SESSIONS_AVAILABLE);
        refused(&mut bench, other(read(READ, 0, 80)), INVALID_SESSION);
        refused(&mut bench, other(read(TERMINATE, 0, 0)), INVALID_SESSION);
        refused(
            &mut bench,
            Ask {
                session: 6,
                ..read(READ, 0, 80)
            },
            INVALID_SESSION,
        );
        refused(
            &mut bench,
            Ask {
                session: 6,
                ..read(BURST, 0, 80)
            },
            INVALID_SESSION,
        );
    }
    bench.run_ms(10_000);
    refused(&mut bench, read(READ, 0, 80), INVALID_SESSION);
    assert_eq!(ask(&mut bench, other(path(OPEN, PACK))).code, ACK);
    refused(&mut bench, path(OPEN, PACK), NO_SESSIONS_AVAILABLE);
    // A reset ends only its sender's sessions, and whoever has one may open another file instead.
    assert_eq!(ask(&mut bench, read(RESET, 0, 0)).code, ACK);
    refused(&mut bench, path(OPEN, PACK), NO_SESSIONS_AVAILABLE);
    assert_eq!(ask(&mut bench, other(read(READ, 0, 80))).code, ACK);
    assert_eq!(ask(&mut bench, other(read(RESET, 0, 0))).code, ACK);
    assert_eq!(ask(&mut bench, path(OPEN, PACK)).code, ACK);
    let faults = ask(&mut bench, path(OPEN, "@SYS/faults.txt")).number();
    assert_eq!(rest(&mut bench, 239).len(), faults as usize);
}

/// A station that takes a signing station's address without the key cannot end its session.
#[test]
fn a_session_of_one_who_signs_is_not_for_who_does_not() {
    let mut bench = signing::keyed();
    let (_, open) = message(path(OPEN, PACK));
    let at = signing::TODAY + signing::SECOND;
    bench.receive(&signing::signed(STATION, &open, &signing::KEY, 1, at));
    assert_eq!(told(&bench.answers())[0].code, ACK);
    refused(&mut bench, path(OPEN, PACK), NO_SESSIONS_AVAILABLE);
    refused(&mut bench, read(TERMINATE, 0, 0), INVALID_SESSION);
    assert_eq!(ask(&mut bench, read(RESET, 0, 0)).code, ACK);
    let (_, read) = message(read(READ, 0, 80));
    let at = at + signing::SECOND;
    bench.receive(&signing::signed(STATION, &read, &signing::KEY, 1, at));
    assert_eq!(told(&bench.answers())[0].code, ACK);
}

#[test]
fn a_long_burst_keeps_its_session() {
    let mut bench = Bench::with(Params::default(), 100);
    let len = ask(&mut bench, path(OPEN, PACK)).number();
    send(&mut bench, read(BURST, 0, 239));
    let told = told(&bench.run_ms(60_000));
    let sum: usize = told.iter().map(|told| told.data.len()).sum();
    assert_eq!(sum, len as usize);
}

#[test]
fn what_is_read_is_of_one_moment() {
    let mut bench = Bench::new();
    let before = fetch(&mut bench, PACK, 239);
    assert_eq!(ask(&mut bench, path(OPEN, PACK)).code, ACK);
    assert_eq!(ask(&mut bench, read(READ, 0, 80)).data, before[..80]);
    bench.params.set(ParamId::LimTempC, 80.0).expect("in range");
    refused(&mut bench, read(READ, 80, 80), INVALID_SESSION);
    // Not even when it is put back: the session is over.
    bench
        .params
        .set(ParamId::LimTempC, 100.0)
        .expect("in range");
    refused(&mut bench, read(READ, 80, 80), INVALID_SESSION);
    assert_eq!(fetch(&mut bench, PACK, 239), before);

    ask(&mut bench, path(OPEN, PACK));
    send(&mut bench, read(BURST, 0, 239));
    bench.params.set(ParamId::LimTempC, 80.0).expect("in range");
    let told = told(&bench.run_ms(100));
    assert_eq!(told.len(), 1);
    assert_eq!((told[0].code, told[0].sequence), (NAK, 301));
    assert_eq!(told[0].data, [INVALID_SESSION]);
    assert_ne!(fetch(&mut bench, PACK, 239), before);
}

#[test]
fn what_cannot_be_done_is_refused_with_the_reason() {
    let mut bench = Bench::new();
    for name in ["", "nothing", "@PARAM/param.pck?start=200"] {
        refused(&mut bench, path(OPEN, name), FILE_NOT_FOUND);
        refused(&mut bench, path(CRC, name), FILE_NOT_FOUND);
    }
    refused(&mut bench, path(LIST, "@ROMFS"), FILE_NOT_FOUND);
    refused(
        &mut bench,
        Ask {
            offset: 4,
            ..path(LIST, "/")
        },
        END_OF_FILE,
    );
    refused(
        &mut bench,
        Ask {
            offset: u32::MAX,
            ..path(LIST, "/")
        },
        END_OF_FILE,
    );
    for code in 6..=13 {
        refused(&mut bench, path(code, PACK), FILE_PROTECTED);
    }
    for code in [16, 100, 127] {
        refused(&mut bench, path(code, PACK), UNKNOWN_COMMAND);
    }
    assert_eq!(ask(&mut bench, path(OPEN, PACK)).code, ACK);
    for code in [READ, BURST] {
        for size in [0, 240, 255] {
            refused(&mut bench, read(code, 0, size), INVALID_DATA_SIZE);
        }
    }
    // A path is no longer than the frame, whatever it claims.
    refused(
        &mut bench,
        Ask {
            size: 239,
            ..path(OPEN, "nothing")
        },
        FILE_NOT_FOUND,
    );
    assert_eq!(
        ask(
            &mut bench,
            Ask {
                size: 239,
                ..path(OPEN, PACK)
            }
        )
        .code,
        ACK
    );
    assert_eq!(ask(&mut bench, Ask { code: 0, ..ASK }).code, ACK);
    // An answer is not answered.
    for code in [ACK, NAK, 255] {
        send(&mut bench, path(code, PACK));
        assert_eq!(bench.answers().len(), 0);
    }
}
