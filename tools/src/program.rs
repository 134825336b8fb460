//! Other programs that do a part of the work.

use std::io::ErrorKind;
use std::process::Command;

use crate::error::Error;

/// A program that must be installed.
pub(crate) struct Program {
    /// Its name on the search path.
    pub(crate) name: &'static str,
    /// How to come by it.
    pub(crate) remedy: &'static str,
}

impl Program {
    /// A command of it, to be given arguments.
    pub(crate) fn command(&self) -> Command {
        Command::new(self.name)
    }

    /// Runs it to its end; gives its standard output where that is piped.
    ///
    /// # Errors
    /// [`Error::Missing`] if it is not installed, [`Error::Program`] if it ends with another status
    /// than 0.
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

    /// That it did not do its part.
    pub(crate) fn failed(&self, reason: &str) -> Error {
        Error::Program {
            program: self.name,
            reason: reason.to_owned(),
        }
    }
}
