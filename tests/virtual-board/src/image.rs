//! The linked image: what goes where in the flash, and its symbols.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use object::elf;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Object, ObjectSymbol};
use thiserror::Error;

/// The board's name, which its image has after the vectors.
const BOARD: &str = "b-g431b-esc1";

/// Why a file is not an image for this board, in one line.
#[derive(Debug, Error)]
pub enum ImageError {
    /// It cannot be read.
    #[error(
        "{}: cannot be read ({source}); make it by cargo build -p siskin-firmware --release \
         --target thumbv7em-none-eabihf --features b-g431b-esc1",
        path.display()
    )]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// It is not a program for the chip.
    #[error("{}: {reason}; give the ELF file that the linker made for the B-G431B-ESC1", path.display())]
    Not {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
}

/// A stretch of bytes to be flashed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Where it is flashed.
    pub address: u32,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

/// The image.
#[derive(Clone, Debug)]
pub struct Image {
    /// What is flashed.
    pub segments: Vec<Segment>,
    symbols: Vec<(String, u32, u32)>,
}

impl Image {
    /// Reads the linker's file.
    pub fn read(path: &Path) -> Result<Self, ImageError> {
        let bytes = fs::read(path).map_err(|source| ImageError::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(&bytes).map_err(|reason| ImageError::Not {
            path: path.to_owned(),
            reason,
        })
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let file = ElfFile32::<object::Endianness>::parse(bytes);
        let file = file.map_err(|error| format!("it is not a 32-bit ELF file ({error})"))?;
        let endian = file.endian();
        if file.elf_header().e_machine.get(endian) != elf::EM_ARM {
            return Err("it is not for an Arm chip".to_owned());
        }
        let mut segments = Vec::new();
        for header in file.elf_program_headers() {
            if header.p_type(endian) != elf::PT_LOAD || header.p_filesz(endian) == 0 {
                continue;
            }
            let address = header.p_paddr(endian);
            let bytes = header.data(endian, bytes);
            let bytes = bytes.map_err(|()| "a segment leaves the file".to_owned())?;
            if !crate::chip::CODE.contains(&address)
                || crate::chip::CODE.end - address < bytes.len() as u32
            {
                return Err(format!("a segment at {address:#010x} is not in the flash"));
            }
            segments.push(Segment {
                address,
                bytes: bytes.to_vec(),
            });
        }
        let holds = |text: &str| {
            let mut segments = segments.iter();
            segments.any(|segment| {
                let mut windows = segment.bytes.windows(text.len());
                windows.any(|window| window == text.as_bytes())
            })
        };
        if !holds(BOARD) {
            return Err(format!("it does not name the board {BOARD}"));
        }
        let symbols = file.symbols().filter_map(|symbol| {
            let name = symbol.name().ok()?.to_owned();
            Some((name, symbol.address() as u32, symbol.size() as u32))
        });
        Ok(Self {
            segments,
            symbols: symbols.collect(),
        })
    }

    /// Returns address and size of the one symbol whose name has all these parts.
    pub fn symbol(&self, parts: &[&str]) -> Option<(u32, u32)> {
        let mut found = self
            .symbols
            .iter()
            .filter(|(name, ..)| parts.iter().all(|part| name.contains(part)));
        let (_, address, bytes) = found.next()?;
        found.next().is_none().then_some((*address, *bytes))
    }
}
