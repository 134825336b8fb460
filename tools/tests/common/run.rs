//! The program under test.

use std::process::{Command, Output};

/// A command's output and exit status.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) status: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

/// Runs it to completion.
pub(crate) fn siskin(arguments: &[&str]) -> Run {
    run(Command::new(env!("CARGO_BIN_EXE_siskin")).args(arguments))
}

/// Runs a prepared command to completion.
pub(crate) fn run(command: &mut Command) -> Run {
    let Output {
        status,
        stdout,
        stderr,
    } = command.output().expect("the binary that cargo built");
    Run {
        status: status.code().expect("it ends by itself"),
        out: String::from_utf8(stdout).expect("text"),
        err: String::from_utf8(stderr).expect("text"),
    }
}
