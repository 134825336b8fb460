//! What an image says of itself. `firmware/src/image.rs` puts it there, and the linker script what follows
//! the texts.

use std::ops::Range;

/// What the tag begins with: the last byte is the version of its layout.
const MARK: [u8; 8] = *b"SISKIN\x00\x02";

/// Bytes of each text, zeros behind it.
const FIELD_BYTES: usize = 24;

/// Where the addresses begin that the check sum is of, from the tag's begin: two ranges of two.
const RANGES_AT: usize = MARK.len() + 3 * FIELD_BYTES;

/// Where the check sum stands, and its inverse.
const SUM_AT: usize = RANGES_AT + 4 * 4;

/// Bytes of all.
const TAG_BYTES: usize = SUM_AT + 2 * 4;

/// Board, version and build of an image, and its check sum.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Tag {
    /// Name of the board.
    pub(crate) board: String,
    /// Version of the firmware.
    pub(crate) version: String,
    /// Hash of the commit that it was built from, with `+` behind it if files differed.
    pub(crate) build: String,
    /// The addresses that its check sum is of.
    pub(crate) ranges: [Range<u32>; 2],
    /// Where that stands, from the contents' begin.
    pub(crate) sum_at: usize,
    /// The check sum and its inverse, all ones where it is not stamped.
    pub(crate) sum: [u32; 2],
}

impl Tag {
    /// The first whole tag in a memory's contents. It begins at a multiple of 4.
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

/// The words that stand in a memory.
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
