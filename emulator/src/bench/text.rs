//! Where a file's text has an error.

/// Formats a TOML error in one line, with its line number.
pub(super) fn toml_reason(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().replace('\n', " ");
    match error.span() {
        Some(span) => format!("line {}: {message}", line_of_byte(text, span.start)),
        None => message,
    }
}

/// Returns the line, from 1, of a byte of a text.
pub fn line_of_byte(text: &str, at: usize) -> usize {
    let before = &text.as_bytes()[..at.min(text.len())];
    before.iter().filter(|byte| **byte == b'\n').count() + 1
}
