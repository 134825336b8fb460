//! Why a link cannot be opened: one actionable line.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::Endpoint;

/// Why a link cannot be opened. Each message is one line: the endpoint, the reason, what to do.
#[derive(Debug, Error)]
pub enum LinkError {
    /// The host's name has no address.
    #[error(
        "--mavlink {endpoint}: the host cannot be resolved ({source}); give an address, such as \
         127.0.0.1"
    )]
    Host {
        /// What was asked for.
        endpoint: Endpoint,
        /// What the resolver said.
        source: io::Error,
    },
    /// Another program listens there.
    #[error(
        "--mavlink {endpoint}: the port is taken; end the program that holds it or give another \
         port (0 takes any free one)"
    )]
    Taken {
        /// What was asked for.
        endpoint: Endpoint,
    },
    /// The system refuses the socket.
    #[error(
        "--mavlink {endpoint}: cannot open the socket ({source}); give an address of this machine"
    )]
    Socket {
        /// What was asked for.
        endpoint: Endpoint,
        /// What the system said.
        source: io::Error,
    },
    /// The serial port cannot be opened.
    #[error(
        "--mavlink {endpoint}: cannot open the serial port ({source}); check its path, its rate \
         and your permission to use it"
    )]
    Serial {
        /// What was asked for.
        endpoint: Endpoint,
        /// What the system said.
        source: io::Error,
    },
    /// No pseudo-terminal is available.
    #[error("--mavlink {endpoint}: no pseudo-terminal ({source}); use udpout or tcpin instead")]
    Pty {
        /// What was asked for.
        endpoint: Endpoint,
        /// What the system said.
        source: io::Error,
    },
    /// The symbolic link cannot be made.
    #[error(
        "--mavlink {endpoint}: cannot make the link {} ({source}); give another path",
        link.display()
    )]
    Symlink {
        /// What was asked for.
        endpoint: Endpoint,
        /// The link.
        link: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The link's path exists and is not a link; it is left alone.
    #[error(
        "--mavlink {endpoint}: {} exists and is not a symbolic link; remove it or give another \
         path",
        link.display()
    )]
    NotASymlink {
        /// What was asked for.
        endpoint: Endpoint,
        /// The path.
        link: PathBuf,
    },
}
