//! What flight controllers send, with their own timing, and what the ESC makes of it.

mod serial;
