//! The flash that holds the parameters, backed by a file or by memory alone.
//!
//! It has the geometry and behaviour of the STM32G4's flash, so that the storage code sees the same on a PC as on the
//! chip (RM0440, 3.3): pages of 2 KiB erase to ones, and a double word is written once after an erase.

mod each;

use std::fs::{self, File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use thiserror::Error;

/// Bytes of a page, which is erased as a whole.
pub const PAGE_BYTES: usize = 2048;

/// Bytes of the flash: two pages.
pub const FLASH_BYTES: usize = 2 * PAGE_BYTES;

/// Bytes of a double word, which is written as a whole.
pub const WORD_BYTES: usize = 8;

/// What an erased byte holds.
pub const ERASED: u8 = 0xFF;

/// Flash backed by a file, which nobody else may read: it holds a signing key. Writes and erases are in the file when
/// the call returns, so they survive a kill of the program, and after [`FileFlash::sync`] a loss of power.
#[derive(Debug)]
pub struct FileFlash {
    content: Box<[u8; FLASH_BYTES]>,
    backing: Option<Backing>,
    fails: bool,
}

/// A file, and its path unless someone has moved it.
#[derive(Debug)]
struct Backing {
    file: File,
    path: PathBuf,
}

/// Why the file cannot serve as flash: one line, with what to do.
#[derive(Debug, Error)]
pub enum StorageError {
    /// The file is not a flash image.
    #[error(
        "--storage {}: the file is corrupt, it has {bytes} bytes instead of {FLASH_BYTES}; remove \
         it to start with defaults, or give another path",
        path.display()
    )]
    Corrupt {
        /// The file.
        path: PathBuf,
        /// Its length.
        bytes: u64,
    },
    /// The path is a folder or a device.
    #[error("--storage {}: it is not a file; give another path or none", .0.display())]
    NotAFile(PathBuf),
    /// Another emulator has it open.
    #[error(
        "--storage {}: another emulator uses it; give this one a path of its own or none",
        .0.display()
    )]
    InUse(PathBuf),
    /// The system refuses it.
    #[error(
        "--storage {}: cannot be opened for reading and writing ({source}); give another path or \
         none",
        path.display()
    )]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system reported.
        source: io::Error,
    },
}

/// Why a flash operation fails. Nothing has changed then.
#[derive(Debug, Error)]
pub enum FlashError {
    /// The range is not whole words or pages.
    #[error("the range is not aligned")]
    NotAligned,
    /// The range exceeds the flash.
    #[error("the range leaves the flash")]
    OutOfBounds,
    /// A word to be written is not erased (PROGERR of the chip).
    #[error("the word at {0:#06x} is not erased")]
    NotErased(u32),
    /// The flash is worn out or protected (PGSERR, WRPERR of the chip).
    #[error("the flash refuses to change")]
    Refused,
    /// The file cannot be written.
    #[error("the storage file cannot be written ({0}); free some room")]
    Io(#[from] io::Error),
    /// Someone has removed or replaced the file, or changed its length.
    #[error("the storage file was removed or cut; start again")]
    Gone,
}

impl FileFlash {
    /// Creates flash that is forgotten at the end.
    pub fn in_memory() -> Self {
        Self {
            content: Box::new([ERASED; FLASH_BYTES]),
            backing: None,
            fails: false,
        }
    }

    /// Makes every write and erase fail from now on, or no longer.
    pub fn fail(&mut self, fails: bool) {
        self.fails = fails;
    }

    /// Opens flash in the file at `path`; creates it, erased, and its folders if it does not exist.
    pub fn open(path: &Path) -> Result<Self, StorageError> {
        let failed = |source| StorageError::Io {
            path: path.to_owned(),
            source,
        };
        match fs::metadata(path) {
            Ok(found) if found.is_file() => {}
            Ok(_) => return Err(StorageError::NotAFile(path.to_owned())),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                create(path).map_err(failed)?;
            }
            Err(error) => return Err(failed(error)),
        }
        let file = OpenOptions::new().read(true).write(true).open(path);
        let file = file.map_err(failed)?;
        if !lock(&file).map_err(failed)? {
            return Err(StorageError::InUse(path.to_owned()));
        }
        keep_private(&file).map_err(failed)?;
        let corrupt = |bytes| StorageError::Corrupt {
            path: path.to_owned(),
            bytes,
        };
        let bytes = file.metadata().map_err(failed)?.len();
        if bytes != FLASH_BYTES as u64 {
            return Err(corrupt(bytes));
        }
        let mut content = Box::new([ERASED; FLASH_BYTES]);
        io::Read::read_exact(&mut &file, content.as_mut_slice()).map_err(failed)?;
        Ok(Self {
            content,
            backing: Some(Backing {
                file,
                path: path.to_owned(),
            }),
            fails: false,
        })
    }

    /// Returns true if what is written outlives the program.
    pub fn is_persistent(&self) -> bool {
        self.backing.is_some()
    }

    /// Checks that what was written will be found at the next start.
    ///
    /// # Errors
    /// [`FlashError::Gone`] if someone has removed the file or changed its length.
    pub fn check(&self) -> Result<(), FlashError> {
        let stands = self.backing.as_ref().is_none_or(Backing::stands);
        if stands {
            Ok(())
        } else {
            Err(FlashError::Gone)
        }
    }

    /// Waits until everything written is on the disk.
    ///
    /// # Errors
    /// As for [`FileFlash::check`], and if the system refuses.
    pub fn sync(&self) -> Result<(), FlashError> {
        self.check()?;
        if let Some(backing) = &self.backing {
            backing.file.sync_data()?;
        }
        Ok(())
    }

    /// Writes `bytes` to the file, then to memory: if the file refuses, nothing has changed.
    fn store(&mut self, offset: usize, bytes: &[u8]) -> Result<(), FlashError> {
        if self.fails {
            return Err(FlashError::Refused);
        }
        if let Some(Backing { file, .. }) = &mut self.backing {
            file.seek(SeekFrom::Start(offset as u64))?;
            file.write_all(bytes)?;
        }
        self.content[offset..offset + bytes.len()].copy_from_slice(bytes);
        Ok(())
    }
}

impl Backing {
    /// Returns true if the path still leads to the file, and it is whole.
    fn stands(&self) -> bool {
        let (Ok(there), Ok(own)) = (fs::metadata(&self.path), self.file.metadata()) else {
            return false;
        };
        is_same(&there, &own) && own.len() == FLASH_BYTES as u64
    }
}

#[cfg(unix)]
fn is_same(a: &fs::Metadata, b: &fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// The standard library has no file numbers here; an open file cannot be removed.
#[cfg(not(unix))]
fn is_same(_a: &fs::Metadata, _b: &fs::Metadata) -> bool {
    true
}

/// Removes other users' rights to the file.
#[cfg(unix)]
fn keep_private(file: &File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    let mode = file.metadata()?.permissions().mode();
    if mode & 0o077 == 0 {
        return Ok(());
    }
    match file.set_permissions(fs::Permissions::from_mode(mode & 0o700)) {
        // Owned by someone else, or a file system without rights: whoever put it there knows.
        Err(error) if error.kind() == io::ErrorKind::PermissionDenied => Ok(()),
        tightened => tightened,
    }
}

/// A user's folder is private here.
#[cfg(not(unix))]
fn keep_private(_file: &File) -> io::Result<()> {
    Ok(())
}

/// Creates an erased file atomically: one cut short by a kill would be found corrupt at the next start. Of two that
/// start at once, both find the first one's file.
fn create(path: &Path) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(format!(".new-{}", std::process::id()));
    let new = path.with_file_name(name);
    let made = File::create(&new)
        .and_then(|mut file| {
            keep_private(&file)?;
            file.write_all(&[ERASED; FLASH_BYTES])
        })
        .and_then(|()| match fs::hard_link(&new, path) {
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
            // Some file systems have no links.
            Err(_) => fs::rename(&new, path),
            Ok(()) => Ok(()),
        });
    // The error that counts is the one that led here, and a renamed file is gone.
    let _ = fs::remove_file(&new);
    made
}

/// Locks the file against other emulators until it is closed. Returns false if one already has it.
#[cfg(unix)]
fn lock(file: &File) -> io::Result<bool> {
    use rustix::fs::{FlockOperation, flock};
    use rustix::io::Errno;
    match flock(file, FlockOperation::NonBlockingLockExclusive) {
        Ok(()) => Ok(true),
        Err(Errno::WOULDBLOCK) => Ok(false),
        // Some network file systems have no locks; the file works without.
        Err(Errno::NOTSUP | Errno::NOLCK | Errno::NOSYS) => Ok(true),
        Err(error) => Err(error.into()),
    }
}

/// The standard library's file locks are newer than the oldest compiler that builds this.
#[cfg(not(unix))]
fn lock(_file: &File) -> io::Result<bool> {
    Ok(true)
}

/// Returns a range of the flash whose ends are multiples of `unit`.
fn range(from: u32, to: usize, unit: usize) -> Result<std::ops::Range<usize>, FlashError> {
    let from = from as usize;
    if from > to || to > FLASH_BYTES {
        Err(FlashError::OutOfBounds)
    } else if !from.is_multiple_of(unit) || !to.is_multiple_of(unit) {
        Err(FlashError::NotAligned)
    } else {
        Ok(from..to)
    }
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::NotAligned => NorFlashErrorKind::NotAligned,
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::NotErased(_) | Self::Refused | Self::Io(_) | Self::Gone => {
                NorFlashErrorKind::Other
            }
        }
    }
}

impl ErrorType for FileFlash {
    type Error = FlashError;
}

impl ReadNorFlash for FileFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let range = range(offset, offset as usize + bytes.len(), Self::READ_SIZE)?;
        bytes.copy_from_slice(&self.content[range]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for FileFlash {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = PAGE_BYTES;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let range = range(from, to as usize, PAGE_BYTES)?;
        self.store(range.start, &[ERASED; FLASH_BYTES][..range.len()])
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let range = range(offset, offset as usize + bytes.len(), WORD_BYTES)?;
        let used = self.content[range.clone()]
            .iter()
            .position(|b| *b != ERASED);
        if let Some(used) = used {
            let word = (range.start + used) / WORD_BYTES * WORD_BYTES;
            return Err(FlashError::NotErased(word as u32));
        }
        self.store(range.start, bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::tempdir;

    fn read(flash: &mut FileFlash, offset: u32, length: usize) -> Vec<u8> {
        let mut bytes = vec![0; length];
        flash.read(offset, &mut bytes).unwrap();
        bytes
    }

    #[test]
    fn it_behaves_as_the_chip() {
        let mut flash = FileFlash::in_memory();
        assert_eq!((flash.capacity(), flash.is_persistent()), (4096, false));
        let word: [u8; 8] = *b"siskin 1";
        flash.write(2040, &word).unwrap();
        flash.write(2048, &word).unwrap();
        assert_eq!(read(&mut flash, 2041, 14), b"iskin 1siskin ");

        // A word is written once, even if bits could still be cleared.
        let again = flash.write(2032, &[0; 16]).unwrap_err();
        assert!(matches!(again, FlashError::NotErased(2040)), "{again}");
        assert_eq!(read(&mut flash, 2032, 8), [0xFF; 8], "nothing has changed");

        flash.erase(0, 2048).unwrap();
        assert_eq!(read(&mut flash, 0, 2048), [0xFF; 2048]);
        assert_eq!(read(&mut flash, 2048, 8), word, "the next page stays");
        flash.write(2040, &word).unwrap();
    }

    #[test]
    fn ranges_are_checked() {
        use NorFlashErrorKind::{NotAligned, OutOfBounds};
        let mut flash = FileFlash::in_memory();
        for (offset, length, kind) in [
            (4, 8, NotAligned),
            (0, 7, NotAligned),
            (4096, 8, OutOfBounds),
            (4088, 16, OutOfBounds),
            (u32::MAX, 8, OutOfBounds),
        ] {
            let error = flash.write(offset, &vec![0; length]).unwrap_err();
            assert_eq!(error.kind(), kind, "{offset} {length}");
        }
        for (from, to, kind) in [
            (0, 2047, NotAligned),
            (8, 2048, NotAligned),
            (2048, 0, OutOfBounds),
            (0, 4097, OutOfBounds),
            (0, u32::MAX, OutOfBounds),
        ] {
            let error = flash.erase(from, to).unwrap_err();
            assert_eq!(error.kind(), kind, "{from} {to}");
        }
        assert!(flash.read(4095, &mut [0; 2]).is_err());
        assert_eq!(read(&mut flash, 0, 4096), [0xFF; 4096]);
    }

    #[test]
    fn a_write_is_in_the_file_at_once() {
        let folder = tempdir().unwrap();
        let path = folder.path().join("a/b/flash");
        let mut flash = FileFlash::open(&path).unwrap();
        assert!(flash.is_persistent());
        flash.write(2048, &[7; 24]).unwrap();
        // What another process would find if this one were killed here.
        let mut wanted = vec![0xFF; FLASH_BYTES];
        wanted[2048..2072].fill(7);
        assert_eq!(fs::read(&path).unwrap(), wanted);
        flash.sync().unwrap();
        drop(flash);

        let mut flash = FileFlash::open(&path).unwrap();
        assert_eq!(read(&mut flash, 0, FLASH_BYTES), wanted);
        flash.erase(2048, 4096).unwrap();
        assert_eq!(fs::read(&path).unwrap(), [0xFF; FLASH_BYTES]);
        let left: Vec<_> = fs::read_dir(path.parent().unwrap()).unwrap().collect();
        assert_eq!(left.len(), 1, "no file of the creation is left");
    }

    #[test]
    fn what_cannot_serve_is_one_line() {
        let folder = tempdir().unwrap();
        let line = |path: &Path| {
            let line = FileFlash::open(path).unwrap_err().to_string();
            assert!(line.contains(&path.display().to_string()), "{line}");
            assert!(!line.contains('\n'), "{line}");
            line
        };
        let path = folder.path().join("flash");
        for bytes in [0, FLASH_BYTES - 1, FLASH_BYTES + 1] {
            fs::write(&path, vec![ERASED; bytes]).unwrap();
            assert!(line(&path).contains(&format!("{bytes} bytes instead of 4096")));
        }
        assert!(line(&path.join("below")).contains("cannot be opened"));
        assert!(line(folder.path()).contains("not a file"));
        assert!(line(Path::new("/proc/flash")).contains("cannot be opened"));

        fs::remove_file(&path).unwrap();
        let _first = FileFlash::open(&path).unwrap();
        assert!(line(&path).contains("another emulator"));
    }

    #[test]
    fn a_file_that_is_removed_replaced_or_cut_is_noticed() {
        type Harm = fn(&Path);
        let harms: [Harm; 4] = [
            |path| fs::remove_file(path).unwrap(),
            |path| fs::rename(path, path.with_extension("old")).unwrap(),
            |path| {
                fs::remove_file(path).unwrap();
                fs::write(path, [ERASED; FLASH_BYTES]).unwrap();
            },
            |path| {
                let file = OpenOptions::new().write(true).open(path).unwrap();
                file.set_len(100).unwrap();
            },
        ];
        for harm in harms {
            let folder = tempdir().unwrap();
            let path = folder.path().join("flash");
            let flash = FileFlash::open(&path).unwrap();
            flash.sync().unwrap();
            harm(&path);
            assert!(matches!(flash.check(), Err(FlashError::Gone)));
            assert!(matches!(flash.sync(), Err(FlashError::Gone)));
        }
    }

    #[cfg(unix)]
    #[test]
    fn nobody_else_may_read_the_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempdir().unwrap();
        let path = folder.path().join("flash");
        let mode = || fs::metadata(&path).unwrap().permissions().mode() & 0o777;
        drop(FileFlash::open(&path).unwrap());
        assert_eq!(mode(), 0o600, "new");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        drop(FileFlash::open(&path).unwrap());
        assert_eq!(mode(), 0o600, "of an earlier version");
    }
}
