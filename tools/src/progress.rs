//! How far an ESC is with something that takes seconds, for a person at a terminal.

use std::io::{self, IsTerminal, Write};

/// A line on standard error that each step replaces. Nothing is shown where standard error is no terminal: there each
/// line is an error.
pub(crate) struct Progress {
    what: &'static str,
    step: String,
    percent: u8,
    on_terminal: bool,
    is_shown: bool,
}

impl Progress {
    pub(crate) fn new(what: &'static str) -> Self {
        Self {
            what,
            step: String::new(),
            percent: 0,
            on_terminal: io::stderr().is_terminal(),
            is_shown: false,
        }
    }

    /// Shows how much is done.
    pub(crate) fn done(&mut self, percent: u8) {
        self.percent = percent.min(100);
        self.show();
    }

    /// Shows what is being done.
    pub(crate) fn step(&mut self, step: &str) {
        self.step = step.to_owned();
        self.show();
    }

    fn show(&mut self) {
        if self.on_terminal {
            let line = line(self.what, self.percent, &self.step);
            self.is_shown = true;
            write(&format!("\r\x1b[K{line}"));
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.is_shown {
            write("\r\x1b[K");
        }
    }
}

/// Without a terminal any more there is nobody to tell.
fn write(text: &str) {
    let mut terminal = io::stderr().lock();
    let _ = terminal.write_all(text.as_bytes());
    let _ = terminal.flush();
}

fn line(what: &str, percent: u8, step: &str) -> String {
    let step = if step.is_empty() {
        String::new()
    } else {
        format!(", {step}")
    };
    format!("{what}: {percent} %{step}; Ctrl-C ends it")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_tells_what_is_done_and_how_to_end_it() {
        assert_eq!(line("self-test", 0, ""), "self-test: 0 %; Ctrl-C ends it");
        assert_eq!(
            line("identification", 40, "phase C"),
            "identification: 40 %, phase C; Ctrl-C ends it"
        );
    }
}
