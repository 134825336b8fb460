//! ELF files, byte by byte: as much of a linker's output as `siskin` reads.

/// An image's tag as the firmware and its linker script lay it out: texts, two address ranges for the
/// check sum, and room for it.
pub(crate) fn tag(board: &str, ranges: [u32; 4]) -> Vec<u8> {
    let mut tag = b"SISKIN\x00\x02".to_vec();
    for field in [board, "0.1.0", "0123456789ab+"] {
        tag.extend_from_slice(field.as_bytes());
        tag.resize(tag.len() + 24 - field.len(), 0);
    }
    words(&mut tag, &ranges);
    words(&mut tag, &[u32::MAX; 2]);
    tag
}

/// Address of the check sum: after the vectors, the texts and the ranges.
const SUM_AT: u32 = 0x1D8 + 96;

/// A file: its machine, and its segments.
#[derive(Clone)]
pub(crate) struct Elf {
    /// 40 is Arm.
    pub(crate) machine: u16,
    /// Type (1 is loadable), load address in the flash, and bytes.
    pub(crate) segments: Vec<(u32, u32, Vec<u8>)>,
}

impl Elf {
    /// Vectors and tag, a hole of 12 bytes, and 70 000 bytes of code that cross a 64 KB boundary.
    pub(crate) fn of(board: &str) -> Self {
        Self::with_code_at(board, FLASH + SUM_AT + 8 + 12)
    }

    /// The same with the code elsewhere.
    pub(crate) fn with_code_at(board: &str, code_at: u32) -> Self {
        const CODE_BYTES: u32 = 70_000;
        let mut first = vec![0x55; 0x1D8];
        let ranges = [FLASH, FLASH + SUM_AT, code_at, code_at + CODE_BYTES];
        first.extend(tag(board, ranges));
        let code = (0..CODE_BYTES).map(|i| (i * 7 % 251) as u8).collect();
        Self {
            machine: 40,
            // Out of order, with a segment that has no file content, and one that is not loadable.
            segments: vec![
                (1, code_at, code),
                (1, 0x2000_0000, Vec::new()),
                (1, FLASH, first),
                (0x6474_E551, 0x2000_0000, vec![1, 2, 3, 4]),
            ],
        }
    }

    /// Returns it with its check sum filled in.
    pub(crate) fn stamped(mut self) -> Self {
        let [code, _, first, _] = &mut self.segments[..] else {
            panic!("four segments")
        };
        let summed = [&first.2[..SUM_AT as usize], &code.2].concat();
        let mut sum = 0x811C_9DC5_u32;
        for word in summed.chunks_exact(4) {
            let word = u32::from_le_bytes(word.try_into().expect("four bytes"));
            sum = (sum.rotate_left(5) ^ word).wrapping_mul(0x0100_0193);
        }
        first.2.truncate(SUM_AT as usize);
        words(&mut first.2, &[sum, !sum]);
        self
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let sections = self.sections();
        let count = self.segments.len() as u32;
        let data = self.segments.iter().map(|(.., data)| data.len() as u32);
        let sections_at = HEADER_BYTES + count * SEGMENT_BYTES + data.sum::<u32>();
        let mut file = b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0".to_vec();
        let half = |file: &mut Vec<u8>, value: u16| file.extend(value.to_le_bytes());
        half(&mut file, 2);
        half(&mut file, self.machine);
        // Version, entry, offsets of segments and sections, flags.
        words(
            &mut file,
            &[1, 0x0800_0401, HEADER_BYTES, sections_at, 0x0500_0400],
        );
        let names = sections.len() as u32 - 1;
        let table = [SECTION_BYTES, sections.len() as u32, names];
        for value in [HEADER_BYTES, SEGMENT_BYTES, count]
            .into_iter()
            .chain(table)
        {
            half(&mut file, value as u16);
        }
        let mut at = HEADER_BYTES + count * SEGMENT_BYTES;
        for (kind, address, data) in &self.segments {
            let length = data.len() as u32;
            // A different run-time address, as for initialised data.
            words(
                &mut file,
                &[*kind, at, 0x2000_0000, *address, length, length, 5, 4],
            );
            at += length;
        }
        for (.., data) in &self.segments {
            file.extend(data);
        }
        let mut at = sections_at + SECTION_BYTES * sections.len() as u32;
        for (name, [kind, flags, address, link, info, entry], data) in &sections {
            let name = NAMES.find(name).expect("a name of the table") as u32;
            let length = data.len() as u32;
            words(
                &mut file,
                &[
                    name, *kind, *flags, *address, at, length, *link, *info, 4, *entry,
                ],
            );
            at += length;
        }
        for (.., data) in &sections {
            file.extend(data);
        }
        file
    }

    /// An interrupt in RAM that calls only itself, by a relocation. Of each section: name; type,
    /// flags, address, linked section, info, entry size; contents.
    fn sections(&self) -> Vec<(&'static str, [u32; 6], Vec<u8>)> {
        // bl to itself.
        let code = [0xFF, 0xF7, 0xFE, 0xFF].to_vec();
        let symbol = |name: &str, value: u32, bytes: u32, kind: u16| {
            let name = NAMES.find(name).expect("a name of the table") as u32;
            let mut symbol = Vec::new();
            words(&mut symbol, &[name, value, bytes]);
            symbol.extend([kind, 1].iter().flat_map(|half| half.to_le_bytes()));
            symbol
        };
        // Global: a function named for each board, and an address.
        let symbols = [
            vec![0; SYMBOL_BYTES as usize],
            symbol("ADC1_2", CONTROL + 1, 4, 0x12),
            symbol("ADC\0", CONTROL + 1, 4, 0x12),
            symbol("__ram_vectors", CONTROL, 0, 0x10),
        ];
        let mut call = Vec::new();
        words(&mut call, &[CONTROL, 1 << 8 | 10]);
        vec![
            ("\0", [0; 6], Vec::new()),
            (".control", [1, 6, CONTROL, 0, 0, 0], code),
            (".symtab", [2, 0, 0, 4, 1, SYMBOL_BYTES], symbols.concat()),
            (".rel", [9, 0, 0, 2, 1, 8], call),
            (".names", [3, 0, 0, 0, 0, 0], NAMES.into()),
        ]
    }
}

const HEADER_BYTES: u32 = 52;
const SEGMENT_BYTES: u32 = 32;
const SECTION_BYTES: u32 = 40;
const SYMBOL_BYTES: u32 = 16;

const FLASH: u32 = 0x0800_0000;

/// Address of the interrupt.
const CONTROL: u32 = 0x1000_0000;

const NAMES: &str = "\0.control\0.symtab\0.rel\0.names\0ADC1_2\0ADC\0__ram_vectors\0";

fn words(bytes: &mut Vec<u8>, words: &[u32]) {
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
}
