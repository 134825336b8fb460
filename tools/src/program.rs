//! Other programs that do part of the work.

use std::io::ErrorKind;
use std::process::Command;

use crate::error::Error;

/// A program that must be installed.
pub(crate) struct Program {
    /// Its name on the search path.
    pub(crate) name: &'static str,
    /// How to get it.
    pub(crate) remedy: &'static str,
}

impl Program {
    /// Returns a command for it, to be given arguments.
    pub(crate) fn command(&self) -> Command {
        Command::new(self.name)
    }

    /// Runs it to completion; returns its standard output if that is piped.
    ///
    /// # Errors
    /// [`Error::Missing`] if it is not installed, [`Error::Program`] if its exit status is not 0.
    pub(crate) fn run(&self, command: &mut Command) -> Result<Vec<u8>, Error> {
        let child = command.spawn().map_err(|e| match e.kind() {
            ErrorKind::NotFound => Error::Missing {
                program: self.name,
                remedy: self.remedy,
            },
            _ => self.failed(&e.to_string()),
        })?;
        let output = child.wait_with_output()?;
        if output.status.success() {
            Ok(output.stdout)
        } else {
            Err(self.failed(&format!("{}; see above", output.status)))
        }
    }

    /// Returns the error that it failed.
    pub(crate) fn failed(&self, reason: &str) -> Error {
        Error::Program {
            program: self.name,
            reason: reason.to_owned(),
        }
    }
}
