//! Where a board's image is.

use std::env;
use std::path::{Path, PathBuf};

/// Resolves a relative path against the workspace.
pub(crate) fn of_workspace(path: impl AsRef<Path>) -> PathBuf {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    workspace.join(path)
}

/// Returns a file of a board's image, where the test command puts it.
pub(crate) fn made(board: &str, extension: &str) -> PathBuf {
    let target = env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into());
    let images = of_workspace(target).join("images");
    images.join(board).with_extension(extension)
}

/// Panics with the command that makes a board's image, by the board and its options, if there is none.
pub(crate) fn is_made(board: &str, path: &Path) {
    assert!(
        path.is_file(),
        "{}: there is no image; make it by cargo run --release -p siskin -- image --board {board} \
         --output target/images",
        path.display()
    );
}
