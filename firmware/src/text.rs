//! Formats numbers for the user: core's formatting would take 3 KB of the image.

use heapless::string::StringView;

/// Appends a number in decimal; digits that do not fit are dropped.
pub(crate) fn push_decimal(text: &mut StringView, number: u32) {
    push_digits(text, number, 10);
}

/// Appends a number in hexadecimal; digits that do not fit are dropped.
pub(crate) fn push_hex(text: &mut StringView, number: u32) {
    push_digits(text, number, 16);
}

// Like `push_digits`, never inlined and for strings of any capacity: one copy serves all.
/// Appends text, unless it does not fit.
#[inline(never)]
pub(crate) fn push(text: &mut StringView, words: &str) {
    let _ = text.push_str(words);
}

#[inline(never)] // many call it
fn push_digits(text: &mut StringView, number: u32, base: u32) {
    let mut worth = 1;
    while number / worth >= base {
        worth *= base;
    }
    while worth > 0 {
        let digit = (number / worth % base) as usize;
        push(text, &"0123456789abcdef"[digit..=digit]);
        worth /= base;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use heapless::String;

    #[test]
    fn numbers_are_as_the_core_library_writes_them() {
        for number in [0, 1, 9, 10, 15, 16, 99, 100, 0x1000, 123_456_789, u32::MAX] {
            let mut text = String::<32>::new();
            push_decimal(&mut text, number);
            push_hex(&mut text, number);
            assert_eq!(text.as_str(), std::format!("{number}{number:x}"));
        }
    }

    #[test]
    fn what_does_not_fit_is_left_out() {
        let mut text = String::<4>::new();
        push(&mut text, "a");
        push_decimal(&mut text, 98_765);
        assert_eq!(text.as_str(), "a987");
    }
}
