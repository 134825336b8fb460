//! The factory values, as the ESC itself has them: a board's may differ from the table built into this
//! program, for example if its least dead time is above the table's.

use std::collections::BTreeMap;

use crate::error::Error;
use crate::ftp;
use crate::param_text;
use crate::session::Session;

/// Every parameter with its default, in ArduPilot's packed format (`shared/src/mavlink/ftp/packed.rs`).
const FILE: &str = "@PARAM/param.pck?withdefaults=1";
const MAGIC: u16 = 0x671C;
const HEADER: usize = 6;
const FLOAT: u8 = 4;
const WITH_DEFAULT: u8 = 1 << 4;

/// The factory values, by name.
#[derive(Debug, PartialEq)]
pub(crate) struct Factory(BTreeMap<String, f32>);

impl Factory {
    /// Reads them from the ESC.
    ///
    /// # Errors
    /// Those of [`ftp::read`], and [`Error::Refused`] if the file has another format.
    pub(crate) fn ask(session: &mut Session) -> Result<Self, Error> {
        let file = ftp::read(session, FILE)?;
        parse(&file).map(Self).ok_or_else(|| Error::Refused {
            what: FILE.into(),
            reason: "its parameters are packed in a format that this program does not know".into(),
        })
    }

    /// Returns the factory value of a parameter that has one.
    pub(crate) fn value(&self, name: &str) -> Option<f32> {
        self.0
            .get(name)
            .copied()
            .filter(|_| param_text::has_factory(name))
    }
}

/// Parses the names and defaults of a packed file; `None` if it is not one.
fn parse(file: &[u8]) -> Option<BTreeMap<String, f32>> {
    let word = |at| Some(u16::from_le_bytes(*file.get(at..)?.first_chunk()?));
    let (magic, count) = (word(0)?, word(2)?);
    if magic != MAGIC {
        return None;
    }
    let mut rest = file.get(HEADER..)?;
    let (mut defaults, mut name) = (BTreeMap::new(), Vec::new());
    for _ in 0..count {
        let [kind, lengths, after @ ..] = rest else {
            return None;
        };
        if kind & !WITH_DEFAULT != FLOAT {
            return None;
        }
        let (letters, after) = after.split_at_checked(usize::from(lengths >> 4) + 1)?;
        name.truncate((lengths & 0xF).into());
        name.extend(letters);
        let (value, after) = after.split_first_chunk()?;
        let (default, after) = if kind & WITH_DEFAULT == 0 {
            (value, after)
        } else {
            after.split_first_chunk()?
        };
        let name = String::from_utf8(name.clone()).ok()?;
        defaults.insert(name, f32::from_le_bytes(*default));
        rest = after;
    }
    rest.is_empty().then_some(defaults)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packed_file_has_names_and_defaults() {
        let mut file = Vec::from(*b"\x1C\x67\x02\0\x09\0");
        file.extend(b"\x14\x50MOT_LU");
        file.extend(1.5_f32.to_le_bytes());
        file.extend(2.5_f32.to_le_bytes());
        file.extend(b"\x04\x14KV");
        file.extend(7.0_f32.to_le_bytes());
        let named = [("MOT_LU", 2.5), ("MOT_KV", 7.0)].map(|(name, value)| (name.into(), value));
        assert_eq!(parse(&file), Some(named.into()));
        // Anything truncated, or in another format, is refused.
        for len in 0..file.len() {
            assert_eq!(parse(&file[..len]), None, "{len}");
        }
        file[0] = 0x1B;
        assert_eq!(parse(&file), None);
    }
}
