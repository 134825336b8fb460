//! Where in a file's text something is wrong.

/// A TOML error in one line, with the line of the text that it is about.
pub(super) fn toml_reason(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().replace('\n', " ");
    match error.span() {
        Some(span) => format!("line {}: {message}", line_of_byte(text, span.start)),
        None => message,
    }
}

/// The line, from 1, of a byte of a text.
pub fn line_of_byte(text: &str, at: usize) -> usize {
    let before = &text.as_bytes()[..at.min(text.len())];
    before.iter().filter(|byte| **byte == b'\n').count() + 1
}
