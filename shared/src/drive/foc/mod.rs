//! Field-oriented control: open-loop start, flying start, Run, Stopping, and Brake with its observer.
//!
//! Each file uses those before it: `state`, `current_loop`, `outer_loop`, `begin`, `open_loop`, `brake`, `period`.

pub(super) mod begin;
pub(super) mod brake;
pub(super) mod current_loop;
pub(super) mod open_loop;
pub(super) mod outer_loop;
pub(super) mod period;
pub(super) mod state;
