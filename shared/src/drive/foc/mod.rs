//! Field-oriented control: open-loop start, flying start, Run, Stopping, and Brake with its observer.
//!
//! Files, each above those that it uses: `state`, `outer_loop`, `open_loop`, `begin`, `current_loop`,
//! `any`, `period`, `short`.

pub(super) mod any;
pub(super) mod begin;
pub(super) mod current_loop;
pub(super) mod open_loop;
pub(super) mod outer_loop;
pub(super) mod period;
pub(super) mod short;
pub(super) mod state;
