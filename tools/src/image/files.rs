//! The files of an image: ELF for probes, HEX for other programs, BIN for those that read neither. The
//! first two leave holes alone, in which parameters may be stored; BIN has them as erased.

use std::fs;
use std::path::{Path, PathBuf};

use ihex::{Record, create_object_file_representation};

use super::Image;
use crate::error::Error;

/// Bytes per line of HEX: as many as other programs write.
const LINE_BYTES: usize = 16;

/// Bytes that the 16 address bits of a HEX line span.
const PAGE_BYTES: u32 = 1 << 16;

/// Writes `BOARD.elf`, `.bin` and `.hex`, or `BOARD-PARTS.elf` and so on, into a folder, which is created if needed, and returns their
/// paths.
///
/// # Errors
/// [`Error::File`] if one cannot be written.
pub(super) fn write(image: &Image, folder: &Path) -> Result<[PathBuf; 3], Error> {
    fs::create_dir_all(folder).map_err(|e| Error::file(folder, e))?;
    let name = |extension| folder.join(format!("{}.{extension}", image.name()));
    let [elf, bin, hex] = [name("elf"), name("bin"), name("hex")];

    fs::write(&elf, &image.file).map_err(|e| Error::file(&elf, e))?;
    fs::write(&bin, image.contents()).map_err(|e| Error::file(&bin, e))?;
    let text = intel_hex(image).map_err(|e| Error::file(&hex, e))?;
    fs::write(&hex, text).map_err(|e| Error::file(&hex, e))?;
    Ok([elf, bin, hex])
}

fn intel_hex(image: &Image) -> Result<String, String> {
    let mut records = Vec::new();
    let mut page = None;
    for piece in &image.pieces {
        let (mut at, mut rest) = (piece.at, piece.bytes.as_slice());
        while !rest.is_empty() {
            let upper = (at / PAGE_BYTES) as u16;
            if page != Some(upper) {
                page = Some(upper);
                records.push(Record::ExtendedLinearAddress(upper));
            }
            let to_page_end = (PAGE_BYTES - at % PAGE_BYTES) as usize;
            let (line, after) = rest.split_at(LINE_BYTES.min(to_page_end).min(rest.len()));
            records.push(Record::Data {
                offset: (at % PAGE_BYTES) as u16,
                value: line.to_vec(),
            });
            at += line.len() as u32;
            rest = after;
        }
    }
    records.push(Record::StartLinearAddress(image.entry));
    records.push(Record::EndOfFile);
    let text = create_object_file_representation(&records).map_err(|e| e.to_string())?;
    Ok(text + "\n")
}
