//! `siskin image`: what goes onto a board, in the formats that flashing programs read.

mod board;
mod build;
mod elf;
mod files;
mod parts;
mod reach;
mod seal;
mod tag;

use std::io::Write;

pub(crate) use board::Board;
pub(crate) use elf::{Image, Piece};
pub(crate) use parts::Parts;
use tag::Tag;

use crate::cli::ImageArgs;
use crate::error::Error;

/// Builds the image if requested, writes the files, and prints what they are.
///
/// # Errors
/// [`Error::Usage`] with nothing to make it from, [`Error::File`] for a file that is not an image or cannot
/// be written, [`Error::Missing`] and [`Error::Program`] if cargo cannot build it.
pub(crate) fn run(args: &ImageArgs, out: &mut dyn Write) -> Result<(), Error> {
    let elf = match (&args.elf, args.board) {
        (Some(elf), _) => elf.clone(),
        (None, Some(board)) => build::build(board, args.parts.as_ref())?,
        (None, None) => return Err(Error::Usage("give an ELF file or --board".to_owned())),
    };
    let image = Image::read(&elf, args.board)?;
    write!(out, "{}", image.description())?;
    for file in files::write(&image, &args.output)? {
        writeln!(out, "wrote    {}", file.display())?;
    }
    Ok(())
}

impl Image {
    /// Returns the name of its files: the board, and its parts behind it unless they are those for flying or all.
    fn name(&self) -> String {
        let board = &self.tag.board;
        match self.tag.version.split_once(' ') {
            // Known words alone: a file may say anything.
            Some((_, parts @ ("papers" | "custom"))) => format!("{board}-{parts}"),
            _ => board.clone(),
        }
    }

    /// Returns board, version, build, size and reach, one per line.
    pub(crate) fn description(&self) -> String {
        let Tag {
            board,
            version,
            build,
            ..
        } = &self.tag;
        let size: usize = self.pieces.iter().map(|piece| piece.bytes.len()).sum();
        let flash = self.board.flash().len();
        format!(
            "board    {board}\nversion  {version}\nbuild    {build}\n\
             size     {size} of {flash} bytes, from {:#010x}\nreach    {}\n",
            self.pieces[0].at, self.reach
        )
    }
}
