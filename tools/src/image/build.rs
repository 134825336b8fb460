//! Builds a board's image with cargo.

use std::path::PathBuf;
use std::process::Stdio;

use serde_json::Value;

use super::Board;
use crate::error::Error;
use crate::program::Program;

const CARGO: Program = Program {
    name: "cargo",
    remedy: "install Rust from https://rustup.rs",
};

/// Builds it, in the repository's folder, and returns the path of the ELF file.
///
/// # Errors
/// [`Error::Missing`] without cargo, [`Error::Program`] if the build fails.
pub(super) fn build(board: Board) -> Result<PathBuf, Error> {
    let mut command = CARGO.command();
    command.args(["build", "--package", "siskin-firmware", "--release"]);
    command.args(["--target", "thumbv7em-none-eabihf"]);
    command.args(["--features", board.name()]);
    // Its messages for people stay on standard error.
    command.arg("--message-format=json-render-diagnostics");
    let messages = CARGO.run(command.stdout(Stdio::piped()))?;
    let executable = String::from_utf8_lossy(&messages)
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).ok())
        .find_map(|message| message["executable"].as_str().map(PathBuf::from));
    executable.ok_or_else(|| CARGO.failed("it reported no executable"))
}
