//! The program's identity, for ground stations (AUTOPILOT_VERSION) and flight controllers (DShot command 6).

use siskin_params::parts::{self, Choice};

/// Version of every program in this repository: major, minor, patch.
pub const VERSION: [u8; 3] = version();

/// The version for people: with its parts behind it where a program lacks some.
pub const VERSION_TEXT: &str = match parts::CHOICE {
    Choice::All => env!("CARGO_PKG_VERSION"),
    Choice::Flight => concat!(env!("CARGO_PKG_VERSION"), " flight"),
    Choice::Papers => concat!(env!("CARGO_PKG_VERSION"), " papers"),
    Choice::Custom => concat!(env!("CARGO_PKG_VERSION"), " custom"),
};

/// A program's parts in a word of eight bytes, for AUTOPILOT_VERSION.
pub const PARTS: &[u8; 8] = match parts::CHOICE {
    Choice::All => b"all\0\0\0\0\0",
    Choice::Flight => b"flight\0\0",
    Choice::Papers => b"papers\0\0",
    Choice::Custom => b"custom\0\0",
};

/// Initial value of the checksum, over no words.
pub const NO_WORDS: u32 = 0x811C_9DC5;

/// Extends an image checksum by more words of flash. Each step is invertible, so damage confined to one word
/// never goes undetected; any other does with probability 2^−32.
pub fn check_sum(before: u32, words: &[u32]) -> u32 {
    words.iter().fold(before, |sum, word| {
        (sum.rotate_left(5) ^ word).wrapping_mul(0x0100_0193)
    })
}

const fn version() -> [u8; 3] {
    let text = env!("CARGO_PKG_VERSION").as_bytes();
    let mut parts = [0; 3];
    let (mut part, mut at) = (0, 0);
    // A suffix such as "-rc1" is dropped.
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
    fn one_damaged_word_changes_the_sum() {
        let words: [u32; 50] = core::array::from_fn(|at| (at as u32).wrapping_mul(0x9E37_79B9));
        let whole = check_sum(NO_WORDS, &words);
        let (first, rest) = words.split_at(20);
        assert_eq!(check_sum(check_sum(NO_WORDS, first), rest), whole);
        for at in 0..words.len() {
            for damage in (0..32).map(|bit| 1 << bit).chain([u32::MAX, 0x8000_0001]) {
                let mut damaged = words;
                damaged[at] ^= damage;
                assert_ne!(check_sum(NO_WORDS, &damaged), whole, "{at}, {damage:#x}");
            }
        }
    }

    #[test]
    fn the_version_is_that_of_the_package() {
        let [major, minor, patch] = VERSION;
        assert_eq!(
            format!("{major}.{minor}.{patch}"),
            env!("CARGO_PKG_VERSION")
        );
    }
}
