//! Ends everything after a failure, and tells the next start why.
//!
//! A failure turns the bridge off first, then writes its cause to memory that start-up does not clear, and
//! resets the chip. The next start takes the record and reports it.

#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
mod record;

#[cfg(board)]
mod fail;

#[cfg(board)]
pub use fail::{fail, restart, take, turn_off};
pub use record::{DETAILS, Failure, TEXT_BYTES};
