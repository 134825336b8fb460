//! `@PARAM/param.pck`: every parameter in one file, in ArduPilot's format.
//!
//! A header of three little-endian `u16`: 0x671B, or 0x671C with defaults; the number of parameters that follow; the
//! number of all. Each parameter has a byte with its type (4: float) and above it the flag 1 if its default follows its
//! value; a byte with the number of letters its name shares with the previous one, and above it the number of differing
//! letters less 1; those letters; the value; and the default if it differs. (ArduPilot, `AP_Filesystem_Param.cpp`.)
//! ArduPilot pads with zeros so that no value straddles two reads; that is unnecessary here, since a file that changes
//! can no longer be read.

use siskin_params::{Board, ParamId, Params};

use super::sink::Sink;

const MAGIC: u16 = 0x671B;
const MAGIC_WITH_DEFAULTS: u16 = 0x671C;
const FLOAT: u8 = 4;
const WITH_DEFAULT: u8 = 1 << 4;
/// `ParamId` is a byte: no more parameters can be requested.
const ALL: u8 = ParamId::ALL.len() as u8;

/// The requested parameters, with their defaults if that is set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Selection {
    first: u8,
    count: u8,
    defaults: bool,
}

impl Selection {
    pub(super) const ALL: Self = Self {
        first: 0,
        count: ALL,
        defaults: false,
    };

    /// Parses `start=N&count=N&withdefaults=1`, in any order; a count of 0 means all. Returns `None` for anything else,
    /// or if there are no such parameters.
    pub(super) fn parse(query: &[u8]) -> Option<Self> {
        let mut selection = Self::ALL;
        for part in query.split(|byte| *byte == b'&') {
            if let Some(value) = part.strip_prefix(b"start=") {
                selection.first = number(value)?;
            } else if let Some(value) = part.strip_prefix(b"count=") {
                selection.count = number(value)?;
            } else {
                selection.defaults = match part {
                    b"withdefaults=1" => true,
                    b"withdefaults=0" => false,
                    _ => return None,
                };
            }
        }
        let rest = ALL.checked_sub(selection.first).filter(|rest| *rest > 0)?;
        if selection.count == 0 || selection.count > rest {
            selection.count = rest;
        }
        Some(selection)
    }

    pub(super) fn write(self, params: &Params, board: &Board, sink: &mut Sink) {
        let magic = if self.defaults {
            MAGIC_WITH_DEFAULTS
        } else {
            MAGIC
        };
        for word in [magic, self.count.into(), ALL.into()] {
            sink.put(&word.to_le_bytes());
        }
        let mut before: &[u8] = &[];
        let chosen = ParamId::ALL.iter().skip(self.first.into());
        for id in chosen.take(self.count.into()) {
            let name = id.entry().name.as_bytes();
            // At least one letter is written; a name has at most 16.
            let mut alike = 0;
            while alike + 1 < name.len() && name.get(alike) == before.get(alike) {
                alike += 1;
            }
            let letters = name.get(alike..).unwrap_or_default();
            let value = params.get(*id);
            let factory = id.factory(board);
            let default = self.defaults && value != factory;
            sink.put(&[
                FLOAT | if default { WITH_DEFAULT } else { 0 },
                alike as u8 | (letters.len() as u8 - 1) << 4,
            ]);
            sink.put(letters);
            sink.put(&value.to_le_bytes());
            if default {
                sink.put(&factory.to_le_bytes());
            }
            before = name;
        }
    }
}

/// Parses a decimal number; anything above the number of parameters is equivalent.
fn number(digits: &[u8]) -> Option<u8> {
    let mut number: u8 = 0;
    for digit in digits {
        let worth = digit.checked_sub(b'0').filter(|worth| *worth <= 9)?;
        number = number.saturating_mul(10).saturating_add(worth);
    }
    (!digits.is_empty()).then_some(number)
}
