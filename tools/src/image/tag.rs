//! What an image says about itself. `firmware/src/image.rs` puts it there; the linker script adds what
//! follows the texts.

use std::ops::Range;

/// What the tag begins with; the last byte is the layout version.
const MARK: [u8; 8] = *b"SISKIN\x00\x02";

/// Bytes per text, zero-padded.
const FIELD_BYTES: usize = 24;

/// Offset in the tag of the address ranges that the checksum covers: two ranges of two addresses.
const RANGES_AT: usize = MARK.len() + 3 * FIELD_BYTES;

/// Offset of the checksum, which its inverse follows.
const SUM_AT: usize = RANGES_AT + 4 * 4;

/// Bytes of the whole tag.
const TAG_BYTES: usize = SUM_AT + 2 * 4;

/// An image's board, version and build, and its checksum.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Tag {
    /// Board name.
    pub(crate) board: String,
    /// Firmware version.
    pub(crate) version: String,
    /// Hash of the commit it was built from, followed by `+` if files differed.
    pub(crate) build: String,
    /// The addresses that its checksum covers.
    pub(crate) ranges: [Range<u32>; 2],
    /// Offset of the checksum in the contents.
    pub(crate) sum_at: usize,
    /// The checksum and its inverse, all ones if not stamped.
    pub(crate) sum: [u32; 2],
}

impl Tag {
    /// Returns the first complete tag in a memory's contents. It begins at a multiple of 4.
    pub(crate) fn find(contents: &[u8]) -> Option<Self> {
        let mut starts = (0..contents.len()).step_by(4);
        starts.find_map(|start| Self::read(start, &contents[start..]))
    }

    fn read(start: usize, bytes: &[u8]) -> Option<Self> {
        let bytes = bytes.get(..TAG_BYTES)?;
        let mut fields = bytes.strip_prefix(&MARK)?.chunks_exact(FIELD_BYTES);
        let mut text = || {
            let field = fields.next()?;
            let end = field.iter().position(|byte| *byte == 0);
            let text = str::from_utf8(&field[..end.unwrap_or(FIELD_BYTES)]).ok()?;
            (!text.is_empty()).then(|| text.to_owned())
        };
        let words: Vec<u32> = words(&bytes[RANGES_AT..]).collect();
        Some(Self {
            board: text()?,
            version: text()?,
            build: text()?,
            ranges: [words[0]..words[1], words[2]..words[3]],
            sum_at: start + SUM_AT,
            sum: [words[4], words[5]],
        })
    }
}

/// Iterates over the words in a memory.
pub(crate) fn words(bytes: &[u8]) -> impl Iterator<Item = u32> {
    let words = bytes.chunks_exact(4);
    words.map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tag(fields: [&str; 3]) -> Vec<u8> {
        let mut bytes = MARK.to_vec();
        for field in fields {
            bytes.extend_from_slice(field.as_bytes());
            bytes.resize(bytes.len() + FIELD_BYTES - field.len(), 0);
        }
        bytes.extend((1..=6_u32).flat_map(u32::to_le_bytes));
        bytes
    }

    #[test]
    fn it_is_found_wherever_a_word_begins() {
        let full = "a-name-of-24-characters!";
        for before in [0, 4, 472] {
            let wanted = Tag {
                board: full.into(),
                version: "0.1.0".into(),
                build: "0123456789ab+".into(),
                ranges: [1..2, 3..4],
                sum_at: before + 96,
                sum: [5, 6],
            };
            let mut contents = vec![0xFF; before];
            contents.extend(tag([full, "0.1.0", "0123456789ab+"]));
            contents.extend([0xFF; 100]);
            assert_eq!(Tag::find(&contents).as_ref(), Some(&wanted));
        }
    }

    #[test]
    fn what_is_not_whole_is_none() {
        let whole = tag(["board", "0.1.0", "unknown"]);
        assert!(Tag::find(&whole).is_some());
        assert_eq!(Tag::find(&whole[..whole.len() - 1]), None);
        assert_eq!(Tag::find(&tag(["board", "", "unknown"])), None);
        assert_eq!(Tag::find(&tag(["b\u{e9}ard", "1", "unknown"])[..20]), None);
        let mut other_layout = whole;
        other_layout[7] = 1;
        assert_eq!(Tag::find(&other_layout), None);
        assert_eq!(Tag::find(&[]), None);
    }
}
