//! The command line of the Siskin ESC.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    siskin::main()
}
