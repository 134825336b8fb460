//! `siskin flash`: writes an image into a board's flash, once it is known to be intact and for that board.
//!
//! What the image does not cover stays: the stored parameters, and the option bytes, without which the
//! B-G431B-ESC1 does not start.

mod dfu;
mod probe;

use std::io::Write;

use crate::cli::FlashArgs;
use crate::error::Error;
use crate::image::Image;

/// Checks the image, writes it with the matching program, and starts it.
///
/// # Errors
/// [`Error::File`] and [`Error::Usage`] before anything is written; [`Error::Missing`] and
/// [`Error::Program`] from the program.
pub(crate) fn run(args: &FlashArgs, out: &mut dyn Write) -> Result<(), Error> {
    let image = Image::read(&args.elf, args.board)?;
    let board = image.board;
    if args.dfu && !board.has_usb() {
        return Err(Error::Usage(format!(
            "--dfu: {} has no USB of its own; leave it out and use the probe",
            board.name()
        )));
    }
    write!(out, "{}", image.description())?;
    out.flush()?;
    if args.dfu {
        dfu::write(&image)?;
        writeln!(
            out,
            "written and verified; release BOOT0 and power-cycle the board"
        )?;
    } else {
        probe::write(&image, args.probe.as_deref())?;
        writeln!(out, "written, verified and started")?;
    }
    Ok(())
}
