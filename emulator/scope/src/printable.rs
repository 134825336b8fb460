//! Text from elsewhere, such as of a file, as a terminal can show it.
//!
//! An escape would set colours or the title, or move the cursor, and a bidirectional override would show a line in
//! another order than it has.

/// Returns one line, in which whatever a terminal obeys or hides is escaped, as `\u{1b}` or `\n`.
pub fn line(text: &str) -> String {
    escaped(text, is_obeyed)
}

/// Returns lines of which each is so.
pub fn lines(text: &str) -> String {
    escaped(text, |c| is_obeyed(c) && c != '\n')
}

fn escaped(text: &str, is_obeyed: fn(char) -> bool) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if is_obeyed(c) {
            shown.extend(c.escape_default());
        } else {
            shown.push(c);
        }
    }
    shown
}

/// Whether a character has an effect in place of a shape: controls, marks of direction, and what has no width.
fn is_obeyed(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{ad}'
                | '\u{61c}'
                | '\u{180e}'
                | '\u{200b}'..='\u{200f}'
                | '\u{2028}'..='\u{202e}'
                | '\u{2060}'..='\u{206f}'
                | '\u{feff}'
                | '\u{fff9}'..='\u{fffb}'
                | '\u{e0000}'..='\u{e007f}'
        )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_is_escaped_and_nothing_else() {
        for (text, shown) in [
            ("motor ½ of 4 °C, i_q ≤ −3 Ω", "motor ½ of 4 °C, i_q ≤ −3 Ω"),
            ("\u{1b}[31mred", "\\u{1b}[31mred"),
            ("\u{1b}]0;title\u{7}", "\\u{1b}]0;title\\u{7}"),
            ("\u{9b}2J", "\\u{9b}2J"),
            ("a\0b\u{7f}", "a\\u{0}b\\u{7f}"),
            ("a\r\tb", "a\\r\\tb"),
            (
                "\u{202e}lmot.exe\u{2069}\u{200b}",
                "\\u{202e}lmot.exe\\u{2069}\\u{200b}",
            ),
        ] {
            assert_eq!(line(text), shown);
            assert_eq!(lines(text), shown);
            assert_eq!(line(shown), shown, "once is enough");
        }
        assert_eq!(line("a\nb"), "a\\nb");
        assert_eq!(lines("a\nb\u{1b}\n"), "a\nb\\u{1b}\n");
    }
}
