//! Builds a board's image with cargo.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::Value;

use super::{Board, Parts};
use crate::error::Error;
use crate::program::Program;

const CARGO: Program = Program {
    name: "cargo",
    remedy: "install Rust from https://rustup.rs",
};

/// Builds it, in the repository's folder, and returns the path of the ELF file. Without a choice of parts it has the
/// board's usual ones.
///
/// # Errors
/// [`Error::Missing`] without cargo, [`Error::TooLarge`] if the chip has no room for it, [`Error::Program`] if the build
/// fails otherwise, [`Error::Usage`] for parts of a board that has them all.
pub(super) fn build(board: Board, parts: Option<&Parts>) -> Result<PathBuf, Error> {
    let mut command = CARGO.command();
    command.args(["build", "--package", "siskin-firmware", "--release"]);
    command.args(["--target", "thumbv7em-none-eabihf"]);
    let mut features = vec![board.name().to_owned()];
    if let Some(parts) = parts {
        if board.has_all_parts() {
            let name = board.name();
            let text = format!("--parts: an image for {name} has all parts; leave it out");
            return Err(Error::Usage(text));
        }
        command.arg("--no-default-features");
        features.extend(parts.features());
    }
    command.args(["--features", &features.join(",")]);
    command.arg("--message-format=json");
    let mut executable = None;
    let mut excess = BTreeMap::new();
    let built = CARGO.run_by_line(&mut command, |line| {
        let Ok(message) = serde_json::from_str::<Value>(line) else {
            return;
        };
        if let Some(path) = message["executable"].as_str() {
            executable = Some(PathBuf::from(path));
        }
        if let Some(text) = message["message"]["rendered"].as_str() {
            let found = overflows(text);
            if found.is_empty() {
                eprint!("{text}");
            }
            for (memory, bytes) in found {
                let most = excess.entry(memory).or_insert(0);
                *most = bytes.max(*most);
            }
        }
    });
    if let Some((memory, bytes)) = excess.pop_first() {
        return Err(Error::TooLarge {
            board: board.name(),
            memory,
            bytes,
        });
    }
    built?;
    executable.ok_or_else(|| CARGO.failed("it reported no executable"))
}

/// Returns the memories that the linker found too small, and by how many bytes.
fn overflows(text: &str) -> Vec<(String, u64)> {
    let found = text.lines().filter_map(|line| {
        let (_, rest) = line.split_once("will not fit in region '")?;
        let (memory, rest) = rest.split_once("': overflowed by ")?;
        let bytes = rest.split_once(" bytes")?.0.parse().ok()?;
        Some((memory.to_owned(), bytes))
    });
    found.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_linker_s_complaint_is_understood() {
        let text = "error: linking with `rust-lld` failed: exit status: 1\n\
                    = note: rust-lld: error: section '.rodata' will not fit in region 'FLASH': overflowed by 1528 bytes\n\
                    rust-lld: error: section '.data' will not fit in region 'FLASH': overflowed by 1608 bytes\n";
        let flash = |bytes| ("FLASH".to_owned(), bytes);
        assert_eq!(overflows(text), [flash(1528), flash(1608)]);
        assert_eq!(overflows("warning: unused variable: `x`"), []);
    }
}
