//! Which image this is: text right behind the vector table, where a tool finds it.

/// Begins the tag.
const MARK: [u8; 8] = *b"SISKIN\x00\x01";

/// Bytes of each text, zeros behind it.
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
    /// The tag of a board's image.
    pub const fn of(board: &str) -> Self {
        Self {
            mark: MARK,
            board: field(board),
            version: field(env!("CARGO_PKG_VERSION")),
            commit: field(env!("SISKIN_COMMIT")),
        }
    }
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

/// What the program says it is on MAVLink; the chip's serial number is added when it runs.
pub const fn identity(board: &'static str, board_number: u16) -> siskin_control::image::Image {
    siskin_control::image::Image {
        board,
        board_number,
        build: build(env!("SISKIN_COMMIT").as_bytes()),
        serial: [0; 12],
    }
}

/// The first eight bytes of the commit's number; zeros where it is not known.
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
