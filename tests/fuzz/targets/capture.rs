//! Feeds any file to `siskin decode`: it is decoded, or refused in one line.
#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use siskin::decode::{DecodeError, Options, decode};
use siskin_fuzz::bytes::Bytes;
use siskin_throttle::signal::Signal;

fuzz_target!(|input: &[u8]| {
    let mut input = Bytes(input);
    let (Some(protocol), Some(style)) = (input.u8(), input.u8()) else {
        return;
    };
    let options = Options {
        channel: (style & 4 != 0).then(|| (style >> 4).to_string()),
        protocol: Signal::from_number(protocol),
        all: style & 1 != 0,
        json: style & 2 != 0,
    };
    let mut out = Vec::new();
    match decode(Cursor::new(input.0), &options, &mut out) {
        Ok(()) => {
            assert!(out.ends_with(b"\n"));
            assert!(std::str::from_utf8(&out).is_ok());
        }
        Err(DecodeError::Capture(reason)) => {
            assert!(!reason.contains('\n'), "{reason}");
            assert!(reason.len() < 10_000, "{reason}");
        }
        Err(DecodeError::Output(error)) => panic!("memory took no more: {error}"),
    }
});
