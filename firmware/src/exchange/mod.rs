//! The memory that the PWM interrupt and the tasks share; each piece has one writer.
//!
//! | piece | from | to | how |
//! |---|---|---|---|
//! | set-point | a task | the interrupt | one atomic word with a sequence number ([`SetpointWriter`]); one that is not renewed is `Stop` |
//! | configuration | a task | the interrupt | two slots, changed over as a whole at the beginning of a period ([`ConfigWriter`]) |
//! | snapshot | the interrupt | the tasks | three places, one always between the two ([`SnapshotReader`]) |
//!
//! Nobody waits: the interrupt must not, and a task that did would wait for an interrupt that it may
//! itself hold up. The two folders of places are proven with loom, which tries every order of their
//! steps.

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
