//! Bits that have changed by themselves.

use super::flash::HALF;
use super::*;

/// Sets, the last of which is in the second half.
fn sets() -> (RamFlash, Vec<Kept>) {
    let mut flash = RamFlash::new();
    let mut sets = Vec::new();
    while flash.bytes[HALF..HALF + WORD] == [0xff; WORD] {
        let kept = everything([0.25, 0.5, 0.75][sets.len() % 3]);
        save(&mut flash, RANGE, &kept).expect("fits");
        sets.push(kept);
    }
    (flash, sets)
}

#[test]
fn a_wrong_byte_anywhere_is_noticed() {
    let (flash, sets) = sets();
    let mut random = Random::new(2);
    for at in 0..flash.bytes.len() {
        let sound = flash.bytes[at];
        let bits = (0..8).map(|bit| sound ^ (1 << bit));
        let others = [!sound, 0, 0xff, random.byte(), random.byte()];
        for byte in bits.chain(others).filter(|byte| *byte != sound) {
            let mut flash = flash.clone();
            flash.bytes[at] = byte;
            let loaded = load(&mut flash, RANGE);
            let trouble = "storage: not whole, an earlier save is in force";
            assert_eq!(loaded.trouble(), Some(trouble), "{byte:#x} at {at}");
            assert!(sets.contains(&loaded.kept), "{byte:#x} at {at}");
        }
    }
}

/// In a set: up to 91 607 bits the check always notices three (P. Koopman, "32-Bit Cyclic Redundancy Codes
/// for Internet Applications", 2002).
#[test]
fn two_and_three_wrong_bits_are_noticed() {
    let (mut flash, sets) = sets();
    let mut random = Random::new(3);
    let begin = 8 * HALF;
    let bits = 8 * WORD * (stored(&mut flash).len() + 1);
    for i in 0..40_000 {
        let mut flash = flash.clone();
        let before = flash.bytes.clone();
        for _ in 0..2 + i % 2 {
            let bit = begin + random.below(bits);
            flash.bytes[bit / 8] ^= 1 << (bit % 8);
        }
        if flash.bytes == before {
            continue;
        }
        let loaded = load(&mut flash, RANGE);
        assert_eq!(loaded.integrity, Integrity::Incomplete, "{i}");
        assert_eq!(loaded.kept, sets[sets.len() - 2], "{i}");
    }
}

#[test]
fn a_value_that_rots_gives_way_to_an_earlier_save() {
    let mut flash = RamFlash::new();
    save(&mut flash, RANGE, &changed()).expect("fits");
    save(&mut flash, RANGE, &Kept::default()).expect("fits");
    // The second set begins at the fifth word.
    flash.bytes[4 * WORD + 4] ^= 1;
    let loaded = load(&mut flash, RANGE);
    assert_eq!(loaded.kept, changed());
    assert_eq!(loaded.integrity, Integrity::Incomplete);
    save(&mut flash, RANGE, &changed()).expect("goes to the other half");
    assert_eq!(sound(&mut flash), changed());
}
