//! A linked image: what goes into the flash, and for which board.

use std::fs;
use std::ops::Range;
use std::path::Path;

use object::LittleEndian;
use object::elf::{EM_ARM, FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};

use super::reach::{self, Reach};
use super::seal::Seal;
use super::{Board, Tag};
use crate::error::Error;

/// What erased flash holds.
pub(super) const ERASED: u8 = 0xFF;

/// Largest gap between two segments that is written as erased, bytes. A larger hole is left alone: on the
/// VESC it holds the stored parameters, between the vectors and the code.
const GAP_BYTES: u32 = 256;

/// A contiguous part of an image.
#[derive(Debug, PartialEq)]
pub(crate) struct Piece {
    /// Address of its first byte.
    pub(crate) at: u32,
    /// What goes there.
    pub(crate) bytes: Vec<u8>,
}

impl Piece {
    pub(super) fn end(&self) -> u32 {
        self.at + self.bytes.len() as u32
    }
}

/// An image that may be flashed.
#[derive(Debug)]
pub(crate) struct Image {
    /// What it says about itself.
    pub(crate) tag: Tag,
    /// The board named in the tag.
    pub(crate) board: Board,
    /// Where it starts to run.
    pub(crate) entry: u32,
    /// Its pieces by address; at least one.
    pub(crate) pieces: Vec<Piece>,
    /// What its PWM interrupt reaches.
    pub(crate) reach: Reach,
    /// The whole ELF file, with the checksum, like the pieces.
    pub(crate) file: Vec<u8>,
}

impl Image {
    /// Reads an ELF file, and checks that it is for a known board (the wanted one, if given), that it fits,
    /// that its PWM interrupt needs nothing from the flash while that is being written, and that it is
    /// intact. Adds the checksum if there is none yet.
    ///
    /// # Errors
    /// [`Error::File`] with the file and what is wrong.
    pub(crate) fn read(path: &Path, wanted: Option<Board>) -> Result<Self, Error> {
        let image = fs::read(path).map_err(|e| e.to_string());
        let image = image.and_then(|bytes| Self::parse(&bytes));
        let image = image.and_then(|image| match wanted {
            Some(wanted) if image.board != wanted => Err(format!(
                "made for {}, not for {}",
                image.board.name(),
                wanted.name()
            )),
            _ => Ok(image),
        });
        image.map_err(|reason| Error::file(path, reason))
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let (mut segments, entry) = segments(bytes)?;
        segments.sort_by_key(|segment| segment.at);
        if segments.is_empty() {
            return Err("nothing in it is for the flash".to_owned());
        }
        // Checked before anything is laid out, since an address may be anything.
        let found = segments.iter();
        let mut found = found.filter_map(|segment| Some((segment.at, Tag::find(segment.data)?)));
        let (tag_from, tag) = found.next().ok_or("it has no Siskin image tag")?;
        let board = Board::named(&tag.board)?;
        let flash = board.flash();
        let mut pieces: Vec<Piece> = Vec::new();
        for &Segment { at, data, .. } in &segments {
            let end = u64::from(at) + data.len() as u64;
            if at < flash.start || end > u64::from(flash.end) {
                return Err(format!(
                    "{at:#010x} to {end:#010x} is not within {:#010x} to {:#010x}, the flash for \
                     images of {}",
                    flash.start,
                    flash.end,
                    board.name()
                ));
            }
            match pieces.last_mut() {
                Some(last) if at < last.end() => {
                    return Err(format!("two of its parts overlap at {at:#010x}"));
                }
                Some(last) if at - last.end() <= GAP_BYTES => {
                    last.bytes.resize((at - last.at) as usize, ERASED);
                    last.bytes.extend_from_slice(data);
                }
                _ => pieces.push(Piece {
                    at,
                    bytes: data.to_vec(),
                }),
            }
        }
        let seal = Seal::of(&tag, tag_from, &pieces)?;
        let mut file = bytes.to_vec();
        for piece in &mut pieces {
            seal.stamp(piece.at, &mut piece.bytes);
        }
        for segment in &segments {
            seal.stamp(segment.at, &mut file[segment.place.clone()]);
        }
        Ok(Self {
            tag,
            board,
            entry,
            pieces,
            reach: reach::judge(bytes, board)?,
            file,
        })
    }

    /// Returns all bytes from the first address to the last, with holes as erased.
    pub(crate) fn contents(&self) -> Vec<u8> {
        let mut contents = Vec::new();
        for piece in &self.pieces {
            contents.resize((piece.at - self.pieces[0].at) as usize, ERASED);
            contents.extend_from_slice(&piece.bytes);
        }
        contents
    }
}

/// A piece to be loaded: its address in the flash, its bytes, and their place in the file.
struct Segment<'a> {
    at: u32,
    data: &'a [u8],
    place: Range<usize>,
}

/// Returns what is to be loaded, and the entry address.
fn segments(bytes: &[u8]) -> Result<(Vec<Segment<'_>>, u32), String> {
    let no_elf = |e| format!("not a 32-bit ELF file: {e}");
    let header = FileHeader32::<LittleEndian>::parse(bytes).map_err(no_elf)?;
    let endian = header.endian().map_err(no_elf)?;
    if header.e_machine(endian) != EM_ARM {
        return Err("not an ELF file for an Arm chip".to_owned());
    }
    let mut segments = Vec::new();
    for segment in header.program_headers(endian, bytes).map_err(no_elf)? {
        if segment.p_type(endian) == PT_LOAD && segment.p_filesz(endian) > 0 {
            let data = segment.data(endian, bytes);
            let data = data.map_err(|()| "the file is truncated".to_owned())?;
            let begin = segment.p_offset(endian) as usize;
            segments.push(Segment {
                at: segment.p_paddr(endian),
                data,
                place: begin..begin + data.len(),
            });
        }
    }
    Ok((segments, header.e_entry(endian)))
}
