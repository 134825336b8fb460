//! What an image says of itself. `firmware/src/image.rs` puts it there.

/// What the tag begins with: the last byte is the version of its layout.
const MARK: [u8; 8] = *b"SISKIN\x00\x01";

/// Bytes of each text, zeros behind it.
const FIELD_BYTES: usize = 24;

/// Board, version and build of an image.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Tag {
    /// Name of the board.
    pub(crate) board: String,
    /// Version of the firmware.
    pub(crate) version: String,
    /// Hash of the commit that it was built from, with `+` behind it if files differed.
    pub(crate) build: String,
}

impl Tag {
    /// The first whole tag in a memory's contents. It begins at a multiple of 4.
    pub(crate) fn find(contents: &[u8]) -> Option<Self> {
        let mut starts = (0..contents.len()).step_by(4);
        starts.find_map(|start| Self::read(&contents[start..]))
    }

    fn read(bytes: &[u8]) -> Option<Self> {
        let mut fields = bytes.strip_prefix(&MARK)?.chunks_exact(FIELD_BYTES);
        let mut text = || {
            let field = fields.next()?;
            let end = field.iter().position(|byte| *byte == 0);
            let text = str::from_utf8(&field[..end.unwrap_or(FIELD_BYTES)]).ok()?;
            (!text.is_empty()).then(|| text.to_owned())
        };
        Some(Self {
            board: text()?,
            version: text()?,
            build: text()?,
        })
    }
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
        bytes
    }

    #[test]
    fn it_is_found_wherever_a_word_begins() {
        let full = "a-name-of-24-characters!";
        let wanted = Tag {
            board: full.into(),
            version: "0.1.0".into(),
            build: "0123456789ab+".into(),
        };
        for before in [0, 4, 472] {
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
        other_layout[7] = 2;
        assert_eq!(Tag::find(&other_layout), None);
        assert_eq!(Tag::find(&[]), None);
    }
}
