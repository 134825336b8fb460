//! A pseudo-terminal: a serial port that another program on this machine opens.

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::{Mode, OFlags};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

use super::tty::Port;
use super::{Endpoint, LinkError};

/// Our end of the pair. Anyone may open the other end; while nobody has it open, reading fails with
/// EIO, which is how a departed reader is noticed.
pub(super) struct Pty {
    master: File,
    path: PathBuf,
    baud: u32,
    link: Option<Symlink>,
}

impl Pty {
    pub(super) fn open(
        endpoint: &Endpoint,
        link: Option<&Path>,
        baud: u32,
    ) -> Result<Self, LinkError> {
        let (master, path) = pair().map_err(|source| LinkError::Pty {
            endpoint: endpoint.clone(),
            source,
        })?;
        let link = match link {
            Some(link) => Some(Symlink::make(endpoint, link, &path)?),
            None => None,
        };
        Ok(Self {
            master,
            path,
            baud,
            link,
        })
    }
}

fn pair() -> io::Result<(File, PathBuf)> {
    let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
    grantpt(&master)?;
    unlockpt(&master)?;
    rustix::io::ioctl_fionbio(&master, true)?;
    let path = PathBuf::from(OsString::from_vec(
        ptsname(&master, Vec::new())?.into_bytes(),
    ));
    // Raw from the start, for readers that set nothing: otherwise the terminal echoes, translates
    // line ends and takes 0x03 for an interrupt. The settings live as long as our end. Closing the
    // other end again makes reading fail until someone opens it.
    let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC;
    let other = rustix::fs::open(&path, flags, Mode::empty())?;
    let mut settings = tcgetattr(&other)?;
    settings.make_raw();
    tcsetattr(&other, OptionalActions::Now, &settings)?;
    Ok((File::from(master), path))
}

impl Port for Pty {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.master.read(buffer)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.master.write(bytes)
    }

    fn revive(&mut self, _now: Duration) {
        // The terminal remains; whoever opens it is back.
    }

    fn endpoint(&self) -> Endpoint {
        let path = self.link.as_ref().map_or(&self.path, |link| &link.path);
        Endpoint::Pty {
            link: Some(path.clone()),
            baud: self.baud,
        }
    }

    fn describe(&self) -> String {
        let (path, baud) = (self.path.display(), self.baud);
        match &self.link {
            Some(link) => format!(
                "pseudo-terminal {} (that is {path}), {baud} baud",
                link.path.display()
            ),
            None => format!("pseudo-terminal {path}, {baud} baud"),
        }
    }
}

/// A symbolic link to the terminal, removed when the program ends.
struct Symlink {
    path: PathBuf,
    target: PathBuf,
}

impl Symlink {
    /// Replaces a link left by an earlier run, and nothing but a link.
    fn make(endpoint: &Endpoint, path: &Path, target: &Path) -> Result<Self, LinkError> {
        let failed = |source| LinkError::Symlink {
            endpoint: endpoint.clone(),
            link: path.to_owned(),
            source,
        };
        match fs::symlink_metadata(path) {
            Ok(found) if found.is_symlink() => fs::remove_file(path).map_err(failed)?,
            Ok(_) => {
                return Err(LinkError::NotASymlink {
                    endpoint: endpoint.clone(),
                    link: path.to_owned(),
                });
            }
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            Err(error) => return Err(failed(error)),
        }
        symlink(target, path).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            target: target.to_owned(),
        })
    }
}

impl Drop for Symlink {
    fn drop(&mut self) {
        // Another run may have put its own there since.
        if fs::read_link(&self.path).is_ok_and(|target| target == self.target) {
            // Nobody is left to report a failure to.
            let _ = fs::remove_file(&self.path);
        }
    }
}
