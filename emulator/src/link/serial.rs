//! A serial port of this machine.

use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serial2::SerialPort;

use super::Endpoint;
use super::tty::Port;

/// Time between attempts to reopen a port that has gone, such as an unplugged USB bridge.
const RETRY: Duration = Duration::from_secs(1);

/// A port that is reopened when it comes back.
pub(super) struct Serial {
    port: Option<SerialPort>,
    tried: Duration,
    path: PathBuf,
    baud: u32,
}

impl Serial {
    pub(super) fn open(path: &Path, baud: u32) -> io::Result<Self> {
        Ok(Self {
            port: Some(open(path, baud)?),
            tried: Duration::ZERO,
            path: path.to_owned(),
            baud,
        })
    }

    fn port(&mut self) -> io::Result<&mut SerialPort> {
        self.port
            .as_mut()
            .ok_or_else(|| io::ErrorKind::NotConnected.into())
    }
}

/// To this library a bare rate means raw, 8N1 and no flow control.
fn open(path: &Path, baud: u32) -> io::Result<SerialPort> {
    let mut port = SerialPort::open(path, baud)?;
    port.set_read_timeout(Duration::ZERO)?;
    port.set_write_timeout(Duration::ZERO)?;
    Ok(port)
}

impl Port for Serial {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.port()?.read(buffer)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.port()?.write(bytes)
    }

    fn revive(&mut self, now: Duration) {
        // The descriptor of an unplugged device never recovers, and holds its name.
        if self.port.take().is_some() {
            self.tried = now;
        } else if now.saturating_sub(self.tried) >= RETRY {
            self.tried = now;
            self.port = open(&self.path, self.baud).ok();
        }
    }

    fn endpoint(&self) -> Endpoint {
        Endpoint::Serial {
            path: self.path.clone(),
            baud: self.baud,
        }
    }

    fn describe(&self) -> String {
        format!("serial port {}, {} baud", self.path.display(), self.baud)
    }
}
