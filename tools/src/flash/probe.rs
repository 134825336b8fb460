//! Through a debug probe, by probe-rs.

use std::path::Path;

use crate::error::Error;
use crate::program::Program;

const PROBE_RS: Program = Program {
    name: "probe-rs",
    remedy: "install it as https://probe.rs says",
};

/// Writes the ELF file, reads it back, and resets the chip. Only the pages of the image are erased.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Program`].
pub(super) fn write(chip: &str, elf: &Path, probe: Option<&str>) -> Result<(), Error> {
    let command = |name| {
        let mut command = PROBE_RS.command();
        command.args([name, "--chip", chip]);
        command.args(probe.into_iter().flat_map(|probe| ["--probe", probe]));
        command
    };
    PROBE_RS.run(command("download").arg("--verify").arg(elf))?;
    PROBE_RS.run(&mut command("reset"))?;
    Ok(())
}
