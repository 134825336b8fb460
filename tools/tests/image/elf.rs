//! ELF files, byte by byte: what a linker makes, as far as a loader looks at it.

/// An image's tag as the firmware lays it out.
pub(crate) fn tag(board: &str) -> Vec<u8> {
    let mut tag = b"SISKIN\x00\x01".to_vec();
    for field in [board, "0.1.0", "0123456789ab+"] {
        tag.extend_from_slice(field.as_bytes());
        tag.resize(tag.len() + 24 - field.len(), 0);
    }
    tag
}

/// One file: its machine, and what it loads.
#[derive(Clone)]
pub(crate) struct Elf {
    /// 40 is Arm.
    pub(crate) machine: u16,
    /// Kind (1 is loaded), address where it stands in the flash, and bytes.
    pub(crate) segments: Vec<(u32, u32, Vec<u8>)>,
}

impl Elf {
    /// Vectors and tag, a hole of 12 bytes, and 70 000 bytes of code that cross a border of 64 KB.
    pub(crate) fn of(board: &str) -> Self {
        let mut first = vec![0x55; 0x1D8];
        first.extend(tag(board));
        let code_at = 0x0800_0000 + first.len() as u32 + 12;
        let code = (0..70_000_u32).map(|i| (i * 7 % 251) as u8).collect();
        Self {
            machine: 40,
            // Not in order, with a segment that only takes memory, and one that is no load.
            segments: vec![
                (1, code_at, code),
                (1, 0x2000_0000, Vec::new()),
                (1, 0x0800_0000, first),
                (0x6474_E551, 0x2000_0000, vec![1, 2, 3, 4]),
            ],
        }
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        const HEADER_BYTES: u32 = 52;
        const SEGMENT_BYTES: u32 = 32;
        let count = self.segments.len() as u32;
        let mut file = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
        let half = |file: &mut Vec<u8>, value: u16| file.extend(value.to_le_bytes());
        let word = |file: &mut Vec<u8>, value: u32| file.extend(value.to_le_bytes());
        half(&mut file, 2);
        half(&mut file, self.machine);
        // Version, entry, segments and sections from the file's start, flags.
        for value in [1, 0x0800_0401, HEADER_BYTES, 0, 0x0500_0400] {
            word(&mut file, value);
        }
        for value in [HEADER_BYTES, SEGMENT_BYTES, count, 40, 0, 0] {
            half(&mut file, value as u16);
        }
        let mut at = HEADER_BYTES + count * SEGMENT_BYTES;
        for (kind, address, data) in &self.segments {
            let length = data.len() as u32;
            // A run-time address that differs, as initialised data has it.
            for value in [*kind, at, 0x2000_0000, *address, length, length, 5, 4] {
                word(&mut file, value);
            }
            at += length;
        }
        for (.., data) in &self.segments {
            file.extend(data);
        }
        file
    }
}
