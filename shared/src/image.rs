//! What a program says it is: to ground stations by AUTOPILOT_VERSION, to flight controllers by
//! DShot's command 6.

/// Version of every program here: major, minor, patch.
pub const VERSION: [u8; 3] = version();

/// A program as it was built for a board, and the chip that it runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Image {
    /// Name of the board, as the build calls it; of its first letters 24 are told.
    pub board: &'static str,
    /// The board's number, `board_version` of AUTOPILOT_VERSION; 0 is the emulator.
    pub board_number: u16,
    /// The first eight bytes of what tells this build from others; zeros if it is not known.
    pub build: [u8; 8],
    /// Serial number of the microcontroller; zeros if there is none.
    pub serial: [u8; 12],
}

impl Image {
    /// The emulator, and tests on a PC.
    pub const EMULATOR: Self = Self {
        board: "emulator",
        board_number: 0,
        build: [0; 8],
        serial: [0; 12],
    };
}

const fn version() -> [u8; 3] {
    let text = env!("CARGO_PKG_VERSION").as_bytes();
    let mut parts = [0; 3];
    let (mut part, mut at) = (0, 0);
    // What follows the third number, as "-rc1", is left out.
    while at < text.len() && part < parts.len() {
        match text[at] {
            digit @ b'0'..=b'9' => parts[part] = parts[part] * 10 + (digit - b'0'),
            b'.' => part += 1,
            _ => part = parts.len(),
        }
        at += 1;
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::format;

    #[test]
    fn the_version_is_that_of_the_package() {
        let [major, minor, patch] = VERSION;
        assert_eq!(
            format!("{major}.{minor}.{patch}"),
            env!("CARGO_PKG_VERSION")
        );
    }
}
