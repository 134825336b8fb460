//! Memory shared by the PWM interrupt and the tasks; each piece has a single writer.
//!
//! | piece | from | to | how |
//! |---|---|---|---|
//! | set-point | a task | the interrupt | one atomic word with a sequence number ([`SetpointWriter`]); one that is not renewed is `Stop` |
//! | configuration | a task | the interrupt | two slots, changed over as a whole at the beginning of a period ([`ConfigWriter`]) |
//! | snapshot | the interrupt | the tasks | three places, one always between the two ([`SnapshotReader`]) |
//!
//! Nobody waits: the interrupt must not, and a task would wait for an interrupt that it may itself be holding
//! up. Configuration and snapshot are verified with loom, which tries every interleaving.

#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
mod latest;
#[cfg_attr(
    not(any(board, test)),
    expect(dead_code, reason = "for the boards; tested on the host")
)]
mod swap;
mod sync;
pub mod word;

#[cfg(board)]
mod cell;
#[cfg(board)]
mod ends;

#[cfg(board)]
pub(crate) use cell::InterruptCell;
#[cfg(board)]
pub use ends::{
    ConfigWriter, Ends, InterruptEnd, RunningEnd, SetpointWriter, SnapshotReader, open,
};
