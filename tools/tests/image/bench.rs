//! A folder with files, and with stand-ins for the real programs.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::PathBuf;
use std::process::Command;

use tempfile::TempDir;

use crate::elf::Elf;
use crate::run::{Run, run};

/// A folder with files and installed stand-ins.
pub(crate) struct Bench {
    folder: TempDir,
    /// Further environment variables for the programs.
    pub(crate) variables: Vec<(&'static str, String)>,
}

impl Bench {
    /// Creates one with only these programs on the search path.
    pub(crate) fn with(programs: &[&str]) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("path");
        fs::create_dir(&path).expect("a folder");
        let stand_in = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/image/stand-in");
        for program in programs {
            symlink(stand_in, path.join(program)).expect("a link");
        }
        Self {
            folder,
            variables: Vec::new(),
        }
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Returns the full path of a file in it.
    pub(crate) fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let path = self.path(name);
        fs::write(&path, bytes).expect("written");
        path.to_str().expect("text").to_owned()
    }

    /// The image of a board.
    pub(crate) fn image(&self, board: &str) -> String {
        self.file("image", Elf::of(board).bytes())
    }

    pub(crate) fn siskin(&self, arguments: &[&str]) -> Run {
        let mut command = Command::new(env!("CARGO_BIN_EXE_siskin"));
        command.args(arguments).env("PATH", self.path("path"));
        command.env("STAND_IN", self.folder.path());
        command.envs(self.variables.iter().map(|(name, value)| (*name, value)));
        run(&mut command)
    }

    /// Returns the programs' invocations, one per line.
    pub(crate) fn asked(&self) -> Vec<String> {
        let log = fs::read_to_string(self.path("log")).unwrap_or_default();
        log.lines().map(str::to_owned).collect()
    }
}
