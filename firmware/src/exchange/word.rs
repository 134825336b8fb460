//! The set-point packed into one word, for a single atomic store.

use fixed::types::I1F31;
use siskin_control::drive::{Excitation, Fault, Pull, Setpoint};
use siskin_units::{Current, Speed};

/// Kind of set-point, in bits 31 to 29.
const KIND_SHIFT: u32 = 29;
const REST: u32 = 0;
const SPEED: u32 = 1;
const TORQUE: u32 = 2;
const TEST: u32 = 3;
const VOLTAGE: u32 = 4;
const TONE: u32 = 5;
const PULL: u32 = 6;
const EXCITE: u32 = 7;

/// Sequence number, in bits 28 to 24.
const SEQUENCE_SHIFT: u32 = 24;
const SEQUENCE_MASK: u32 = 0x1f;

/// Value, in bits 23 to 0: the upper 24 bits of a speed, a current, a pitch or a share. A speed's step is then
/// 0.0072 mechanical rpm with 12 pole pairs at 24 kHz.
const VALUE_SHIFT: u32 = 8;
const VALUE_MASK: u32 = 0x00ff_ffff;

/// Packs a set-point with the lowest five bits of a sequence number.
pub fn pack(setpoint: Setpoint, sequence: u32) -> u32 {
    let value = |bits: i32| (bits as u32) >> VALUE_SHIFT;
    let (kind, value) = match setpoint {
        Setpoint::Stop => (REST, 0),
        Setpoint::Zero => (REST, 1),
        Setpoint::Fault(fault) => (REST, fault as u32 + 2),
        Setpoint::Speed(speed) => (SPEED, value(speed.to_bits())),
        Setpoint::Torque(current) => (TORQUE, value(current.to_bits())),
        Setpoint::Test(current) => (TEST, value(current.to_bits())),
        Setpoint::Tone(pitch) => (TONE, value(pitch.to_bits())),
        Setpoint::Pull(pull) => (PULL, pull as u32),
        Setpoint::Excite(excitation) => (EXCITE, excitation.to_word()),
        Setpoint::Voltage(share) => (VOLTAGE, value(share.to_bits())),
    };
    kind << KIND_SHIFT | (sequence & SEQUENCE_MASK) << SEQUENCE_SHIFT | value
}

/// Unpacks a word's set-point.
pub fn unpack(word: u32) -> Setpoint {
    // The shift drops kind and sequence number and puts the sign back at bit 31.
    let bits = (word << VALUE_SHIFT) as i32;
    match word >> KIND_SHIFT {
        SPEED => Setpoint::Speed(Speed::from_bits(bits)),
        TORQUE => Setpoint::Torque(Current::from_bits(bits)),
        TEST => Setpoint::Test(Current::from_bits(bits)),
        TONE => Setpoint::Tone(Speed::from_bits(bits)),
        PULL => Setpoint::Pull(Pull::from_number(word as u8)),
        EXCITE => Excitation::from_word(word).map_or(Setpoint::Stop, Setpoint::Excite),
        VOLTAGE => Setpoint::Voltage(I1F31::from_bits(bits)),
        _ => rest(word & VALUE_MASK),
    }
}

/// Returns a set-point that does not turn the motor.
fn rest(number: u32) -> Setpoint {
    match number {
        0 => Setpoint::Stop,
        1 => Setpoint::Zero,
        _ => Fault::of_number((number - 2) as u8).map_or(Setpoint::Stop, Setpoint::Fault),
    }
}

#[cfg(test)]
mod tests {
    use siskin_control::drive::Ripple;
    use siskin_params::parts::Identification;

    use super::*;

    #[test]
    fn every_setpoint_comes_back_within_the_value_s_step() {
        let current = Current::from_num(-3.25);
        let mut all = vec![
            Setpoint::Stop,
            Setpoint::Zero,
            Setpoint::Torque(current),
            Setpoint::Test(-current),
            Setpoint::Tone(Speed::from_num(0.125)),
            Setpoint::Voltage(I1F31::from_num(-0.75)),
            Setpoint::Speed(Speed::from_bits(-0x1234_5600)),
        ];
        all.extend(Pull::ALL.map(Setpoint::Pull));
        for (phase, ripple) in [(0, Ripple::None), (1, Ripple::Along), (2, Ripple::Across)] {
            let current = Current::from_num(0.375);
            let part = Identification::get();
            let excitation = part.map(|part| Excitation::new(part, phase, current, ripple));
            all.extend(excitation.map(Setpoint::Excite));
        }
        all.extend(Fault::ALL.map(Setpoint::Fault));
        for setpoint in all {
            for number in [0, 1, 31] {
                let word = pack(setpoint, number);
                assert_eq!(unpack(word), setpoint);
                assert_ne!(pack(setpoint, number + 1), word);
            }
        }
        // Bits that do not fit the word are rounded down.
        let fine = Setpoint::Speed(Speed::from_bits(0x1234_56ff));
        let coarse = Setpoint::Speed(Speed::from_bits(0x1234_5600));
        assert_eq!(unpack(pack(fine, 5)), coarse);
    }

    #[test]
    fn the_sequence_number_wraps() {
        assert_eq!(pack(Setpoint::Zero, 32), pack(Setpoint::Zero, 0));
        assert_eq!(unpack(pack(Setpoint::Zero, 33)), Setpoint::Zero);
    }

    #[test]
    fn a_word_that_nobody_writes_is_stop() {
        assert_eq!(unpack(10), Setpoint::Stop);
        assert_eq!(unpack(0), Setpoint::Stop);
    }
}
