//! Other programs that do part of the work.

use std::io::{BufRead as _, BufReader, ErrorKind};
use std::process::{Child, Command, Stdio};

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
        let output = self.spawn(command)?.wait_with_output()?;
        if output.status.success() {
            Ok(output.stdout)
        } else {
            Err(self.failed(&format!("{}; see above", output.status)))
        }
    }

    /// Runs it to completion and hands over each line of its standard output as it comes.
    ///
    /// # Errors
    /// As for [`Program::run`].
    pub(crate) fn run_by_line(
        &self,
        command: &mut Command,
        mut take: impl FnMut(&str),
    ) -> Result<(), Error> {
        let mut child = self.spawn(command.stdout(Stdio::piped()))?;
        for line in child
            .stdout
            .take()
            .into_iter()
            .flat_map(|out| BufReader::new(out).lines())
        {
            take(&line?);
        }
        let status = child.wait()?;
        if status.success() {
            Ok(())
        } else {
            Err(self.failed(&format!("{status}; see above")))
        }
    }

    fn spawn(&self, command: &mut Command) -> Result<Child, Error> {
        command.spawn().map_err(|e| match e.kind() {
            ErrorKind::NotFound => Error::Missing {
                program: self.name,
                remedy: self.remedy,
            },
            _ => self.failed(&e.to_string()),
        })
    }

    /// Returns the error that it failed.
    pub(crate) fn failed(&self, reason: &str) -> Error {
        Error::Program {
            program: self.name,
            reason: reason.to_owned(),
        }
    }
}
