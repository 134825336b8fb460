//! Bit rot.

use super::flash::HALF;
use super::*;

/// Sets, the last of them in the second half.
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
            let trouble = "storage: incomplete, an older save may apply";
            assert_eq!(loaded.trouble(), Some(trouble), "{byte:#x} at {at}");
            assert_eq!(Some(&loaded.kept), sets.last(), "{byte:#x} at {at}");
        }
    }
}

/// Within a set: up to 91 607 bits the CRC always detects three errors (P. Koopman, "32-Bit Cyclic Redundancy
/// Codes for Internet Applications", 2002).
#[test]
fn two_and_three_wrong_bits_are_noticed() {
    let (mut flash, sets) = sets();
    let mut random = Random::new(3);
    let newest = Log::open(&mut flash, RANGE)
        .expect("two pages")
        .newest
        .values;
    let begin = 8 * newest.start as usize;
    let bits = 8 * (newest.len() + WORD);
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
        assert_eq!(Some(&loaded.kept), sets.last(), "{i}: the other copy");
    }
}

/// So that no motor is driven with another one's settings.
#[test]
fn a_wrong_bit_in_the_only_save_changes_nothing_that_was_set() {
    let mut flash = RamFlash::new();
    save(&mut flash, RANGE, &changed()).expect("fits");
    let written = flash.bytes.iter().filter(|byte| **byte != 0xff).count();
    assert!(written > 2 * 4 * WORD / 2, "{written}");
    for bit in 0..8 * flash.bytes.len() {
        let mut flash = flash.clone();
        flash.bytes[bit / 8] ^= 1 << (bit % 8);
        let loaded = load(&mut flash, RANGE);
        assert_eq!(loaded.kept, changed(), "{bit}");
        assert_eq!(loaded.integrity, Integrity::Incomplete, "{bit}");
        // The next save, of anything, makes two of them again.
        save(&mut flash, RANGE, &loaded.kept).expect("goes to the other half");
        assert_eq!(sound(&mut flash), changed());
    }
}

#[test]
fn where_both_copies_of_the_only_save_rot_all_is_lost() {
    let mut flash = RamFlash::new();
    save(&mut flash, RANGE, &changed()).expect("fits");
    let copy = 8 * 4 * WORD;
    for (a, b) in (0..copy).zip((copy..2 * copy).rev()) {
        let mut flash = flash.clone();
        for bit in [a, b] {
            flash.bytes[bit / 8] ^= 1 << (bit % 8);
        }
        let loaded = load(&mut flash, RANGE);
        assert_eq!(loaded.kept, Kept::default());
        assert!(loaded.integrity.is_lost(), "{a} {b}: {loaded:?}");
    }
}

#[test]
fn where_both_copies_rot_an_earlier_save_is_in_force() {
    let mut flash = RamFlash::new();
    save(&mut flash, RANGE, &changed()).expect("fits");
    save(&mut flash, RANGE, &Kept::default()).expect("fits");
    // Four words twice, then two words twice.
    for at in [8, 10] {
        flash.bytes[at * WORD + 4] ^= 1;
    }
    let loaded = load(&mut flash, RANGE);
    assert_eq!(loaded.kept, changed());
    let trouble = "storage: incomplete, an older save may apply";
    assert_eq!(loaded.trouble(), Some(trouble));
    save(&mut flash, RANGE, &changed()).expect("goes to the other half");
    assert_eq!(sound(&mut flash), changed());
}
