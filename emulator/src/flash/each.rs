//! The flash of several ESCs.

use std::path::Path;

use super::{FileFlash, StorageError};

impl FileFlash {
    /// Opens the flash of each ESC: a single one in the file at `path`; of several, each with its number appended.
    ///
    /// # Errors
    /// As [`FileFlash::open`].
    pub fn open_each(path: &Path, escs: usize) -> Result<Vec<Self>, StorageError> {
        if escs == 1 {
            return Ok(vec![Self::open(path)?]);
        }
        let numbered = |esc| {
            let mut name = path.as_os_str().to_owned();
            name.push(format!(".{esc}"));
            Self::open(Path::new(&name))
        };
        (0..escs).map(numbered).collect()
    }
}
