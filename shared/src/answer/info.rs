//! The ESC's information, requested by DShot command 6: 64 bytes on the serial line.
//!
//! The layout is BLHeli_32's, which flight controllers know and print (Betaflight: `dshotprog 0 6`):
//!
//! | byte | what it is |
//! |---|---|
//! | 0 to 11 | serial number of the microcontroller |
//! | 12 | 254: this layout |
//! | 13, 14 | firmware version, printed as 1.02 |
//! | 15 | type, not printed |
//! | 16 | direction: 0 normal, 1 reversed |
//! | 17 | 3D: 0 off, 1 on |
//! | 18 | minimum supply voltage, 0.1 V, 0 off |
//! | 19 | current limit, A, 0 off |
//! | 20 to 23 | lights 0 to 3: 0 off, 1 on, 255 absent |
//! | 31 to 62 | name and board, zero-padded |
//! | 63 | checksum, as in a KISS frame |

use siskin_params::{Image, ParamId, Params};
use siskin_units::math::round;

use super::kiss::crc8;
use crate::image::VERSION;

/// Length in bytes.
pub const BYTES: usize = 64;

/// The minimum time from its start to the next frame's on the line, µs: its 640 bits take 5556.
pub const SPACING_US: u32 = 6000;

/// In byte 12, tells a reader the layout.
const LAYOUT: u8 = 254;
/// Marks a missing feature.
const UNSUPPORTED: u8 = 255;
/// The highest value that cannot be mistaken for [`UNSUPPORTED`].
const MOST: f32 = 254.0;

const NAME: &[u8] = b"Siskin ";
/// Length of bytes 31 to 62.
const NAME_BYTES: usize = 32;

/// Returns the information for these parameters and this state of the light.
pub fn info(params: &Params, light: bool, image: &Image) -> [u8; BYTES] {
    let get = |id| params.get(id);
    // Conversions saturate, and a limit below one unit still shows as a limit.
    let limit = |value: f32| {
        let least = if value > 0.0 { 1.0 } else { 0.0 };
        round(value).clamp(least, MOST) as u8
    };
    let mut bytes = [0; BYTES];
    bytes[..12].copy_from_slice(&image.serial);
    bytes[12] = LAYOUT;
    bytes[13..15].copy_from_slice(&version());
    bytes[16] = get(ParamId::MotDir) as u8;
    bytes[17] = get(ParamId::Inp3d) as u8;
    bytes[18] = limit(get(ParamId::LimBusVMin) * 10.0);
    bytes[19] = limit(get(ParamId::LimPhaseA));
    bytes[20] = u8::from(light);
    bytes[21..24].fill(UNSUPPORTED);
    bytes[31..31 + NAME_BYTES].copy_from_slice(&name(image.board));
    bytes[BYTES - 1] = crc8(&bytes[..BYTES - 1]);
    bytes
}

/// Returns the major version, and the minor one with the patch: 0.1.0 becomes 0 and 10, printed as 0.10.
fn version() -> [u8; 2] {
    let [major, minor, patch] = VERSION;
    [major, minor.saturating_mul(10).saturating_add(patch)]
}

/// Returns the product name and as much of the board's as fits.
fn name(board: &str) -> [u8; NAME_BYTES] {
    let mut name = [0; NAME_BYTES];
    let bytes = NAME.iter().copied().chain(board.bytes());
    // Keep a terminating zero.
    for (to, byte) in name[..NAME_BYTES - 1].iter_mut().zip(bytes) {
        *to = byte;
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMAGE: Image = Image {
        serial: *b"0123456789ab",
        ..Image::EMULATOR
    };

    /// As Betaflight reads it: `printEscInfo` in its command line.
    #[test]
    fn a_flight_controller_reads_it() {
        let mut params = Params::default();
        let values = [
            (ParamId::MotDir, 1.0),
            (ParamId::Inp3d, 1.0),
            (ParamId::LimBusVMin, 13.2),
            (ParamId::LimPhaseA, 35.0),
        ];
        for (id, value) in values {
            params.set(id, value).expect("in range");
        }
        let bytes = info(&params, true, &IMAGE);
        assert_eq!(bytes[12], 254);
        assert_eq!(bytes[13..15], version());
        assert_eq!(bytes[16..24], [1, 1, 132, 35, 1, 255, 255, 255]);
        let name = bytes[31..63].split(|byte| *byte == 0).next();
        assert_eq!(name, Some(&b"Siskin emulator"[..]));
        assert_eq!(bytes[..12], IMAGE.serial);
        assert_eq!(crc8(&bytes), 0);
    }

    #[test]
    fn a_limit_never_looks_as_if_there_were_none() {
        let mut params = Params::default();
        params.set(ParamId::LimBusVMin, 0.0).expect("in range");
        params.set(ParamId::LimPhaseA, 0.5).expect("in range");
        let bytes = info(&params, false, &IMAGE);
        assert_eq!(bytes[18..21], [0, 1, 0]);
        params.set(ParamId::LimBusVMin, 60.0).expect("in range");
        params.set(ParamId::LimPhaseA, 200.0).expect("in range");
        assert_eq!(info(&params, false, &IMAGE)[18..20], [254, 200]);
    }
}
