//! The image's identity, as text right after the vector table where a tool finds it, and its checksum.
//!
//! After the tag the linker script places the address range that the checksum covers, and room for the sum and
//! its inverse. The linker leaves both erased: such an image is unstamped and starts unchecked, so that cargo's
//! output runs as it is. `siskin image` stamps; `siskin flash` stamps an unstamped image, and refuses a damaged
//! one; a stamped image that is damaged starts into [`damaged`](crate::damaged). The check takes 1.4 ms of a
//! G431's start, on the virtual board.

use siskin_control::image::VERSION_TEXT;
#[cfg(board)]
use siskin_control::image::{NO_WORDS, check_sum};

/// Starts the tag; the last byte is its layout version.
const MARK: [u8; 8] = *b"SISKIN\x00\x02";

/// Bytes of each text, zero-padded.
const FIELD_BYTES: usize = 24;

/// The tag: a mark, then board, version and git commit.
#[repr(C)]
pub struct Image {
    mark: [u8; 8],
    board: [u8; FIELD_BYTES],
    version: [u8; FIELD_BYTES],
    commit: [u8; FIELD_BYTES],
}

impl Image {
    /// Creates the tag for a board's image.
    pub const fn of(board: &str) -> Self {
        Self {
            mark: MARK,
            board: field(board),
            version: field(VERSION_TEXT),
            commit: field(env!("SISKIN_COMMIT")),
        }
    }
}

/// Returns true if the flash matches its stamp, or has none.
#[cfg(board)]
pub fn is_whole() -> bool {
    unsafe extern "C" {
        static __vector_table: u32;
        static __check_sum: [u32; 2];
        static __program: u32;
        static __image_end: u32;
    }
    let words = |begin: *const u32, end: *const u32| {
        let (begin, end) = (begin as usize, end as usize);
        // SAFETY: the linker script places the image between the two addresses, which are multiples of four,
        // and nothing writes there.
        unsafe { core::slice::from_raw_parts(begin as *const u32, (end - begin) / 4) }
    };
    // SAFETY: lies in flash; volatile, since stamping changes what the compiler saw.
    let [sum, inverse] = unsafe { (&raw const __check_sum).read_volatile() };
    if sum & inverse == u32::MAX {
        return true;
    }
    let head = words(&raw const __vector_table, (&raw const __check_sum).cast());
    let program = words(&raw const __program, &raw const __image_end);
    inverse == !sum && check_sum(check_sum(NO_WORDS, head), program) == sum
}

const fn field(text: &str) -> [u8; FIELD_BYTES] {
    let bytes = text.as_bytes();
    assert!(bytes.len() <= FIELD_BYTES, "too long for the tag");
    let mut field = [0; FIELD_BYTES];
    let mut at = 0;
    while at < bytes.len() {
        field[at] = bytes[at];
        at += 1;
    }
    field
}

/// Returns the program's identity for MAVLink; the chip's serial number is filled in at run time.
pub const fn identity(board: &'static str, board_number: u16) -> siskin_params::Image {
    siskin_params::Image {
        board,
        board_number,
        build: build(env!("SISKIN_COMMIT").as_bytes()),
        serial: [0; 12],
    }
}

/// Returns the first eight bytes of the commit hash; zeros if it is unknown.
const fn build(commit: &[u8]) -> [u8; 8] {
    let mut build = [0; 8];
    let mut at = 0;
    while at < 2 * build.len() && at < commit.len() {
        let Some(digit) = (commit[at] as char).to_digit(16) else {
            return [0; 8];
        };
        build[at / 2] = build[at / 2] << 4 | digit as u8;
        at += 1;
    }
    build
}
