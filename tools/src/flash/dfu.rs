//! Flashes over USB, through the chip's own bootloader and dfu-util.

use std::fs;

use crate::error::Error;
use crate::image::{Image, Piece};
use crate::program::Program;

const DFU_UTIL: Program = Program {
    name: "dfu-util",
    remedy: "install the package dfu-util",
};

/// The USB id of every STM32's bootloader, and its alternate setting for the flash.
const LOADER: [&str; 4] = ["--device", "0483:df11", "--alt", "0"];

/// Writes the image piece by piece and compares what the flash then holds. The bootloader keeps running:
/// dfu-util cannot tell a chip that has left it from one that has failed.
///
/// # Errors
/// [`Error::Missing`] or [`Error::Program`]; [`Error::Output`] if there is no room for temporary files.
pub(super) fn write(image: &Image) -> Result<(), Error> {
    let folder = tempfile::tempdir()?;
    let bin = folder.path().join("image.bin");
    let command = |address: String| {
        let mut command = DFU_UTIL.command();
        command.args(LOADER).args(["--dfuse-address", &address]);
        command
    };
    for (number, Piece { at, bytes }) in image.pieces.iter().enumerate() {
        fs::write(&bin, bytes)?;
        // dfu-util does not overwrite an existing file.
        let back = folder.path().join(format!("back-{number}.bin"));
        let begin = format!("{at:#010x}");
        let whole = format!("{begin}:{}", bytes.len());
        DFU_UTIL.run(command(begin).arg("--download").arg(&bin))?;
        DFU_UTIL.run(command(whole).arg("--upload").arg(&back))?;
        if fs::read(&back)? != *bytes {
            return Err(DFU_UTIL.failed("the flash does not contain what was written; try again"));
        }
    }
    Ok(())
}
