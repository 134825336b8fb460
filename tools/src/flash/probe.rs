//! Flashes through a debug probe, with probe-rs.

use std::fs;

use crate::error::Error;
use crate::image::Image;
use crate::program::Program;

const PROBE_RS: Program = Program {
    name: "probe-rs",
    remedy: "install it as described at https://probe.rs",
};

/// Writes the image as an ELF file, reads it back, and resets the chip. Only the image's pages are erased.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Program`]; [`Error::Output`] if there is no room for the temporary file.
pub(super) fn write(image: &Image, probe: Option<&str>) -> Result<(), Error> {
    let folder = tempfile::tempdir()?;
    let elf = folder.path().join("image.elf");
    fs::write(&elf, &image.file)?;
    let chip = image.board.chip();
    let command = |name| {
        let mut command = PROBE_RS.command();
        command.args([name, "--chip", chip]);
        command.args(probe.into_iter().flat_map(|probe| ["--probe", probe]));
        command
    };
    PROBE_RS.run(command("download").arg("--verify").arg(&elf))?;
    PROBE_RS.run(&mut command("reset"))?;
    Ok(())
}
