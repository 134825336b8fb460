//! The file with the key, and what must not be used twice: the time of the last signature.

use std::fmt::Write as _;
use std::fs;
use std::io::{self, BufRead as _, Write as _};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use tempfile::NamedTempFile;

use super::Key;
use crate::error::Error;

/// What stands at its head.
const HEAD: &str = "# A MAVLink signing key: whoever reads it can change every ESC that has it.\n\
                    # The time of the last signature grows; copies of this file need links of their own.\n";

/// A key file.
#[derive(Debug, PartialEq)]
pub(super) struct KeyFile {
    path: PathBuf,
    pub(super) key: Key,
    /// The link that this copy signs for.
    pub(super) link: u8,
    /// The latest timestamp used with it.
    pub(super) time: u64,
}

impl KeyFile {
    pub(super) fn read(path: &Path) -> Result<Self, Error> {
        let text = fs::read_to_string(path).map_err(|error| Error::file(path, error))?;
        parse(path, &text).ok_or_else(|| {
            let reason = "is no signing key; 'siskin key new FILE' makes one";
            Error::file(path, reason)
        })
    }

    /// Writes the latest timestamp used.
    pub(super) fn keep(&mut self, time: u64) -> Result<(), Error> {
        self.time = time;
        self.write().map_err(|error| {
            let reason = format!("cannot keep the time of the last signature: {error}");
            Error::file(&self.path, reason)
        })
    }

    /// Puts the file in place whole, readable by its owner alone.
    fn write(&self) -> io::Result<()> {
        let mut file = NamedTempFile::new_in(folder(&self.path))?;
        file.write_all(self.text().as_bytes())?;
        file.persist(&self.path)?;
        Ok(())
    }

    fn text(&self) -> String {
        let mut text = format!("{HEAD}key ");
        for byte in self.key {
            // Writing to a String cannot fail.
            let _ = write!(text, "{byte:02x}");
        }
        let _ = write!(text, "\nlink {}\ntime {}\n", self.link, self.time);
        text
    }
}

/// Makes a file with a new key: of a passphrase, or a random one.
///
/// # Errors
/// [`Error::File`] if it exists, or cannot be written.
pub(crate) fn create(path: &Path, of_passphrase: Option<Key>) -> Result<(), Error> {
    let mut random = [0; 33];
    getrandom::fill(&mut random).map_err(|error| Error::file(path, error))?;
    let [link, key @ ..] = random;
    let file = KeyFile {
        path: path.to_owned(),
        key: of_passphrase.unwrap_or(key),
        // Other stations use small numbers.
        link: link | 0x80,
        time: 0,
    };
    if path.exists() {
        return Err(Error::file(
            path,
            "exists; a key that is lost cannot be replaced, so name another file",
        ));
    }
    file.write().map_err(|error| Error::file(path, error))
}

/// Reads a passphrase from a line of standard input, and makes the key of it that ground stations make.
///
/// # Errors
/// [`Error::Usage`] if there is none.
pub(crate) fn passphrase() -> Result<Key, Error> {
    let mut line = String::new();
    io::stdin().lock().read_line(&mut line)?;
    let phrase = line.trim_end_matches(['\r', '\n']);
    if phrase.is_empty() {
        return Err(Error::Usage(
            "--passphrase: give it as a line on standard input".into(),
        ));
    }
    Ok(Sha256::digest(phrase).into())
}

fn folder(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

fn parse(path: &Path, text: &str) -> Option<KeyFile> {
    let (mut key, mut link, mut time) = (None, None, None);
    for line in text.lines().map(str::trim) {
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        match line.split_once(' ')? {
            ("key", digits) => key = Some(key_of(digits.trim())?),
            ("link", number) => link = Some(number.trim().parse().ok()?),
            ("time", number) => time = Some(number.trim().parse().ok()?),
            _ => return None,
        }
    }
    Some(KeyFile {
        path: path.to_owned(),
        // All zeros remove a key.
        key: key.filter(|key| *key != [0; 32])?,
        link: link?,
        // A timestamp has 48 bits.
        time: time.filter(|time| *time < 1 << 48)?,
    })
}

fn key_of(digits: &str) -> Option<Key> {
    if digits.len() != 64 || !digits.is_ascii() {
        return None;
    }
    let mut key = [0; 32];
    for (at, byte) in key.iter_mut().enumerate() {
        *byte = u8::from_str_radix(digits.get(2 * at..2 * at + 2)?, 16).ok()?;
    }
    Some(key)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_as_it_is_written_and_nothing_else_is_a_key() {
        let path = Path::new("key");
        let file = KeyFile {
            path: path.into(),
            key: std::array::from_fn(|at| at as u8),
            link: 200,
            time: 36_000_000_000_000,
        };
        let text = file.text();
        assert_eq!(parse(path, &text), Some(file));
        for wrong in [
            String::new(),
            "passphrase".into(),
            text.replace("key 00", "key 0g"),
            text.replace("key 00", "key "),
            text.replace("link 200", "link 256"),
            text.replace("time 36", "time -36"),
            text.replace("time 36", "time 936"),
            text.replace("link 200\n", ""),
            format!("{text}more 1\n"),
            format!("key {}\nlink 1\ntime 1\n", "0".repeat(64)),
        ] {
            assert_eq!(parse(path, &wrong), None, "{wrong}");
        }
    }
}
