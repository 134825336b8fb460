//! An image's checksum, by which `siskin flash` and the chip's start-up refuse a damaged one. The linker
//! leaves it erased; it is filled in when the image is read.

use siskin_control::image::{NO_WORDS, check_sum};

use super::elf::{ERASED, Piece};
use super::tag::{Tag, words};

/// What an unstamped image holds in place of the sum and its inverse.
const NOT_STAMPED: [u32; 2] = [u32::MAX; 2];

/// The sum and its inverse, as they are to stand at an address.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Seal {
    at: u32,
    sum: [u32; 2],
}

impl Seal {
    /// Computes the sum over all pieces; the tag begins at address `tag_from`.
    ///
    /// # Errors
    /// The image is stamped and damaged, or not as the linker makes it.
    pub(super) fn of(tag: &Tag, tag_from: u32, pieces: &[Piece]) -> Result<Self, String> {
        let at = tag_from.wrapping_add(tag.sum_at as u32);
        let [head, program] = &tag.ranges;
        let behind = at.wrapping_add(8);
        let is_sound = pieces.first().is_some_and(|piece| piece.at == head.start)
            && head.end == at
            && (behind..=program.end).contains(&program.start)
            && pieces.last().is_some_and(|piece| piece.end() == program.end)
            && [head, program].iter().all(|range| range.start % 4 == 0 && range.end % 4 == 0)
            // What is in neither range is a hole, or the sum.
            && pieces.iter().all(|piece| !(behind..program.start).contains(&piece.at));
        if !is_sound {
            return Err("damaged: the addresses after its tag do not match its parts".to_owned());
        }
        let contents = |range: &std::ops::Range<u32>| -> Vec<u32> {
            let mut bytes = vec![ERASED; range.len()];
            for piece in pieces {
                for (byte, at) in piece.bytes.iter().zip(piece.at..) {
                    if range.contains(&at) {
                        bytes[(at - range.start) as usize] = *byte;
                    }
                }
            }
            words(&bytes).collect()
        };
        let sum = check_sum(check_sum(NO_WORDS, &contents(head)), &contents(program));
        let sum = [sum, !sum];
        if tag.sum != NOT_STAMPED && tag.sum != sum {
            return Err(format!(
                "damaged: its contents have the check sum {:08x}, and it says {:08x} {:08x}; make it anew \
                 with 'siskin image'",
                sum[0], tag.sum[0], !tag.sum[1]
            ));
        }
        Ok(Self { at, sum })
    }

    /// Writes it into bytes that begin at an address.
    pub(super) fn stamp(&self, begin: u32, bytes: &mut [u8]) {
        let sum = self.sum.iter().flat_map(|word| word.to_le_bytes());
        for (byte, at) in sum.zip(self.at..) {
            let place = at
                .checked_sub(begin)
                .and_then(|at| bytes.get_mut(at as usize));
            if let Some(place) = place {
                *place = byte;
            }
        }
    }
}
