//! The record of a failure, with a checksum: memory may hold anything after power-up.

use heapless::String;

use crate::text::{push, push_decimal, push_hex};

/// Longest text, that of a STATUSTEXT.
pub const TEXT_BYTES: usize = 50;

/// Words that a failure records besides its kind; all fit the text.
pub const DETAILS: usize = 4;

/// Why the processor stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Failure {
    /// A panic: return addresses, innermost call first. Resolve files and lines with `addr2line` from the debug
    /// information; in the image each would take 100 bytes.
    Panic = 1,
    /// A hard fault: program counter and fault status.
    HardFault = 2,
    /// The stack left its memory: program counter and fault status.
    StackOverflow = 3,
    /// An interrupt without a handler: its number, negative for an exception.
    UnexpectedInterrupt = 4,
    /// The control interrupt has not run for 50 ms.
    Standstill = 6,
}

/// The record left for the next start.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub(super) struct Record {
    failure: u32,
    details: [u32; DETAILS],
    check: u32,
}

impl Record {
    /// Creates the record of a failure.
    pub(super) fn new(failure: Failure, details: [u32; DETAILS]) -> Self {
        let mut record = Self {
            failure: failure as u32,
            details,
            check: 0,
        };
        record.check = record.sum();
        record
    }

    /// Creates an empty record.
    pub(super) const fn empty() -> Self {
        Self {
            failure: 0,
            details: [0; DETAILS],
            check: 0,
        }
    }

    /// Returns a checksum over all words that neither zeros nor repeated words satisfy.
    fn sum(&self) -> u32 {
        let mix = |sum: u32, word: u32| (sum.rotate_left(5) ^ word).wrapping_mul(0x0100_0193);
        self.details
            .iter()
            .fold(mix(0x5151_3c1e, self.failure), |sum, word| mix(sum, *word))
    }

    /// Returns the text for the user, or `None` if nothing is recorded.
    pub(super) fn text(&self) -> Option<String<TEXT_BYTES>> {
        if self.check != self.sum() {
            return None;
        }
        let [first, second, ..] = self.details;
        let mut text = String::new();
        push(&mut text, "Restart: ");
        match self.failure {
            1 => {
                push(&mut text, "panic");
                for call in self.details {
                    push(&mut text, " ");
                    push_hex(&mut text, call);
                }
            }
            2 => {
                push(&mut text, "hard fault at ");
                push_hex(&mut text, first);
                push(&mut text, ", status ");
                push_hex(&mut text, second);
            }
            3 => {
                push(&mut text, "stack overflow at ");
                push_hex(&mut text, first);
            }
            4 => {
                push(&mut text, "unexpected interrupt ");
                if (first as i32) < 0 {
                    push(&mut text, "-");
                }
                push_decimal(&mut text, (first as i32).unsigned_abs());
            }
            6 => push(&mut text, "the control stood still"),
            _ => return None,
        }
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(failure: Failure, details: [u32; DETAILS]) -> std::string::String {
        let record = Record::new(failure, details);
        record.text().expect("it is whole").as_str().into()
    }

    #[test]
    fn a_failure_is_told_in_words() {
        assert_eq!(
            text(
                Failure::Panic,
                [0x2000_1e54, 0x0800_1235, 0x0801_c6b5, 0x0800_0201]
            ),
            "Restart: panic 20001e54 8001235 801c6b5 8000201"
        );
        assert_eq!(
            text(Failure::HardFault, [0x0800_1234, 0x8200, 0, 0]),
            "Restart: hard fault at 8001234, status 8200"
        );
        assert_eq!(
            text(Failure::StackOverflow, [0x0800_1234, 0, 0, 0]),
            "Restart: stack overflow at 8001234"
        );
        assert_eq!(
            text(Failure::UnexpectedInterrupt, [(-12_i32) as u32, 0, 0, 0]),
            "Restart: unexpected interrupt -12"
        );
        assert_eq!(
            text(Failure::Standstill, [0; DETAILS]),
            "Restart: the control stood still"
        );
    }

    #[test]
    fn every_text_fits() {
        let most = [u32::MAX; DETAILS];
        for failure in [Failure::Panic, Failure::HardFault, Failure::StackOverflow] {
            let longest = text(failure, most);
            assert!(longest.ends_with(" ffffffff"), "{longest}");
        }
        assert_eq!(text(Failure::Panic, most).len(), TEXT_BYTES);
    }

    #[test]
    fn what_memory_holds_by_chance_is_no_record() {
        assert_eq!(Record::empty().text(), None);
        let mut record = Record::new(Failure::Panic, [1, 2, 3, 4]);
        record.details[1] ^= 0x10;
        assert_eq!(record.text(), None);
        for byte in [0x00, 0xff, 0xaa] {
            let word = u32::from_ne_bytes([byte; 4]);
            let record = Record {
                failure: word,
                details: [word; DETAILS],
                check: word,
            };
            assert_eq!(record.text(), None);
        }
    }
}
