//! The PC's files, word by word, in a few large pieces: each one takes a call of the emulator.

use semihosting::fs::File;
use semihosting::io::{self, Read, Write};
use siskin_on_target::{ANSWER_FILE, REQUEST_FILE};

const BYTES: usize = 32 * 1024;

/// Reads the request.
pub(crate) struct Reader {
    file: File,
    bytes: [u8; BYTES],
    next: usize,
    end: usize,
}

impl Reader {
    pub(crate) fn open() -> io::Result<Self> {
        Ok(Self {
            file: File::open(REQUEST_FILE)?,
            bytes: [0; BYTES],
            next: 0,
            end: 0,
        })
    }

    /// Returns the next `N` words, or `None` if fewer are left.
    pub(crate) fn next<const N: usize>(&mut self) -> io::Result<Option<[u32; N]>> {
        let mut words = [0; N];
        for word in &mut words {
            if self.next == self.end {
                self.next = 0;
                self.end = self.file.read(&mut self.bytes)?;
                if self.end == 0 {
                    return Ok(None);
                }
            }
            let bytes = self.bytes[self.next..].first_chunk();
            *word = u32::from_le_bytes(*bytes.expect("files and pieces are of whole words"));
            self.next += 4;
        }
        Ok(Some(words))
    }
}

/// Writes the answer.
pub(crate) struct Writer {
    file: File,
    bytes: [u8; BYTES],
    len: usize,
}

impl Writer {
    pub(crate) fn create() -> io::Result<Self> {
        Ok(Self {
            file: File::create(ANSWER_FILE)?,
            bytes: [0; BYTES],
            len: 0,
        })
    }

    pub(crate) fn put(&mut self, words: &[u32]) -> io::Result<()> {
        for word in words {
            self.bytes[self.len..self.len + 4].copy_from_slice(&word.to_le_bytes());
            self.len += 4;
            if self.len == BYTES {
                self.flush()?;
            }
        }
        Ok(())
    }

    pub(crate) fn flush(&mut self) -> io::Result<()> {
        self.file.write_all(&self.bytes[..self.len])?;
        self.len = 0;
        Ok(())
    }
}
