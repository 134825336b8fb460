//! What can go wrong: one line for a person, and an exit status for a script.

use std::fmt::Display;
use std::io;
use std::path::Path;
use std::process::ExitCode;

/// Why the work was not done. Each text names the input and the remedy.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    /// An argument that makes no sense.
    #[error("{0}")]
    Usage(String),

    /// The endpoint could not be opened, or was lost.
    #[error("{endpoint}: {reason}; {remedy}")]
    Link {
        endpoint: String,
        reason: String,
        remedy: &'static str,
    },

    /// The page cannot be served.
    #[error("{0}")]
    Page(#[from] siskin_scope::SiteError),

    /// Nothing that could be an ESC was heard.
    #[error("{endpoint}: {heard}")]
    NoComponent { endpoint: String, heard: String },

    /// A file could not be read, written or parsed.
    #[error("{path}: {reason}")]
    File { path: String, reason: String },

    /// A program that does part of the work is not installed.
    #[error("{program} is not installed: {remedy}")]
    Missing {
        program: &'static str,
        remedy: &'static str,
    },

    /// An image with these parts is larger than a memory of the chip.
    #[error("{board}: {bytes} bytes too many for its {memory}; give --parts fewer parts")]
    TooLarge {
        board: &'static str,
        memory: String,
        bytes: u64,
    },

    /// A program that does part of the work has failed.
    #[error("{program}: {reason}")]
    Program {
        program: &'static str,
        reason: String,
    },

    /// The ESC refused.
    #[error("{what}: {reason}")]
    Refused { what: String, reason: String },

    /// The ESC did not answer, however often it was asked.
    #[error("{what}: no answer after {attempts} attempts; check the link and try again")]
    NoAnswer { what: String, attempts: u32 },

    /// A signal came while the ESC did something for this program.
    #[error("{what}: interrupted; {ended}")]
    Interrupted {
        what: String,
        ended: &'static str,
        signal: u8,
    },

    /// Nothing came for a while.
    #[error("{what}: nothing for {seconds} s; check the link and TEL_RATE_HZ")]
    Silent { what: String, seconds: u64 },

    /// Some of several items were refused; each has been listed.
    #[error("{0}")]
    Partly(String),

    /// Standard output cannot be written.
    #[error("standard output: {0}")]
    Output(#[from] io::Error),
}

impl Error {
    /// A file could not be read, written or parsed, for this reason.
    pub(crate) fn file(path: &Path, reason: impl Display) -> Self {
        Self::File {
            path: path.display().to_string(),
            reason: reason.to_string(),
        }
    }

    /// Returns 2 for bad input or no connection, 1 if the ESC or another program refused or did not answer,
    /// 128 and the number of the signal that ended it, as a shell does, 0 if only the reader of the output went away, as in `siskin monitor | head -1`.
    pub(crate) fn exit_code(&self) -> ExitCode {
        match self {
            Self::Usage(_)
            | Self::Link { .. }
            | Self::Page(_)
            | Self::NoComponent { .. }
            | Self::File { .. }
            | Self::Missing { .. }
            | Self::TooLarge { .. } => ExitCode::from(2),
            Self::Program { .. }
            | Self::Refused { .. }
            | Self::NoAnswer { .. }
            | Self::Silent { .. }
            | Self::Partly(_) => ExitCode::from(1),
            Self::Interrupted { signal, .. } => ExitCode::from(128 + signal),
            Self::Output(e) if e.kind() == io::ErrorKind::BrokenPipe => ExitCode::SUCCESS,
            Self::Output(_) => ExitCode::from(2),
        }
    }
}
