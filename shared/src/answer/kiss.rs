//! KISS telemetry on a serial line: 115200 baud, 8N1, ten bytes, big-endian.

use siskin_units::math::round;

use crate::telemetry::Telemetry;

/// Bytes in a frame.
pub const BYTES: usize = 10;

/// The minimum time from one frame's start to the next, µs: a frame's 100 bits take 868.
pub const SPACING_US: u32 = 1000;

/// Returns a frame: °C, 0.01 V, 0.01 A, mAh and hundreds of electrical rpm, each saturated, and a checksum. A
/// negative, braking current is sent as 0, since the field is unsigned. So is a temperature below 0 °C: the
/// protocol makes it signed, but Betaflight, PX4 and ArduPilot read the byte as unsigned, and took −10 °C for
/// 246.
pub fn frame(telemetry: &Telemetry, erpm: f32) -> [u8; BYTES] {
    let mut frame = [0; BYTES];
    // Float conversion saturates and maps NaN to 0.
    frame[0] = (round(telemetry.temperature_c) as i8).max(0) as u8;
    let words = [
        telemetry.bus_v * 100.0,
        telemetry.bus_a * 100.0,
        telemetry.consumed_mah,
        erpm / 100.0,
    ];
    for (place, word) in frame[1..].chunks_exact_mut(2).zip(words) {
        place.copy_from_slice(&(round(word) as u16).to_be_bytes());
    }
    frame[BYTES - 1] = crc8(&frame[..BYTES - 1]);
    frame
}

/// Returns the KISS frames' CRC-8: polynomial 0x07, initial value 0.
pub fn crc8(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| {
            let carry = crc & 0x80 != 0;
            crc << 1 ^ if carry { 0x07 } else { 0 }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_sum_is_crc_8_smbus() {
        // This CRC's check value in every catalogue.
        assert_eq!(crc8(b"123456789"), 0xF4);
    }

    #[test]
    fn a_known_frame() {
        let telemetry = Telemetry {
            temperature_c: 41.4,
            bus_v: 24.003,
            bus_a: 7.5,
            consumed_mah: 258.2,
            ..Telemetry::new()
        };
        let frame = frame(&telemetry, 72_040.0);
        let wanted = [41, 0x09, 0x60, 0x02, 0xEE, 0x01, 0x02, 0x02, 0xD0];
        assert_eq!(frame[..9], wanted);
        assert_eq!(crc8(&frame), 0, "the check sum of all ten is 0");
    }

    #[test]
    fn what_is_too_large_stays_at_the_end_of_its_range() {
        let telemetry = Telemetry {
            temperature_c: 300.0,
            bus_v: 700.0,
            bus_a: -3.0,
            consumed_mah: 1e6,
            ..Telemetry::new()
        };
        let wanted = [127, 255, 255, 0, 0, 255, 255, 255, 255];
        assert_eq!(frame(&telemetry, 1e7)[..9], wanted);
        let cold = Telemetry {
            temperature_c: -10.0,
            ..Telemetry::new()
        };
        assert_eq!(frame(&cold, 0.0)[0], 0);
        let unknown = Telemetry {
            temperature_c: f32::NAN,
            ..Telemetry::new()
        };
        assert_eq!(frame(&unknown, 0.0)[0], 0);
    }
}
