//! Recordings that still grow while they are fetched.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// Where recordings stand on the site, before their number.
const PLACE: &str = "/recording/";

/// The longest line at whose end a text is cut: one of a table or of a value change dump is far shorter.
const LINE_BYTES: u64 = 4096;

/// The recording that a path of the site names, if it is one.
pub(crate) fn named<'a>(recordings: &'a [PathBuf], path: &str) -> Option<&'a Path> {
    let number = path.strip_prefix(PLACE)?.parse::<usize>().ok()?;
    recordings.get(number).map(PathBuf::as_path)
}

/// What has been recorded so far, and its length: of a text whole lines.
///
/// # Errors
/// It cannot be read.
pub(crate) fn open(path: &Path) -> io::Result<(io::Take<File>, u64)> {
    let mut file = File::open(path)?;
    let mut length = file.metadata()?.len();
    let extension = path.extension().unwrap_or_default();
    if extension == "csv" || extension == "vcd" {
        let from = length.saturating_sub(LINE_BYTES);
        file.seek(SeekFrom::Start(from))?;
        let mut tail = Vec::new();
        file.by_ref().take(length - from).read_to_end(&mut tail)?;
        if let Some(last) = tail.iter().rposition(|byte| *byte == b'\n') {
            length = from + last as u64 + 1;
        }
        file.rewind()?;
    }
    Ok((file.take(length), length))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_ends_with_a_whole_line() {
        let folder = tempfile::tempdir().unwrap();
        let long = "x".repeat(3 * LINE_BYTES as usize);
        for (name, written, wanted) in [
            ("a.csv", "t_s,rpm\n0.1,2\n0.2", "t_s,rpm\n0.1,2\n"),
            ("a.vcd", &format!("{long}\nb1"), &format!("{long}\n")),
            ("a.tlog", "frames\nand a part", "frames\nand a part"),
            ("b.csv", "", ""),
        ] {
            let path = folder.path().join(name);
            std::fs::write(&path, written).unwrap();
            let (mut file, length) = open(&path).unwrap();
            let mut read = String::new();
            file.read_to_string(&mut read).unwrap();
            assert_eq!((read.as_str(), length as usize), (wanted, wanted.len()));
        }
    }

    #[test]
    fn only_what_is_recorded_has_a_name() {
        let recordings = [PathBuf::from("a.csv"), PathBuf::from("b.csv")];
        let found = |path| named(&recordings, path).map(Path::to_owned);
        assert_eq!(found("/recording/1"), Some("b.csv".into()));
        for path in [
            "/recording/2",
            "/recording/",
            "/recording/../a.csv",
            "/a.csv",
            "/recording/-1",
        ] {
            assert_eq!(found(path), None, "{path}");
        }
    }
}
