//! A parameter set by a program as a ground station does, by PARAM_SET.

use siskin_control::esc;
use siskin_params::ParamId;
use thiserror::Error;

use super::Laboratory;
use crate::parameter::set_frame;

/// Why a value is rejected; one line.
#[derive(Debug, Error)]
#[error("{name} = {value} is refused: {reason}")]
pub struct Refused {
    name: &'static str,
    value: f32,
    reason: &'static str,
}

impl Laboratory {
    /// Returns the value of an ESC's parameter in force.
    pub fn param(&self, esc: usize, id: ParamId) -> f32 {
        self.esc(esc).esc().params().get(id)
    }

    /// Sets an ESC's parameter to a value in its range. The drive has it within a millisecond.
    ///
    /// # Errors
    /// The ESC refuses it, for instance because the motor turns, or it is beyond the board.
    pub fn set_param(&mut self, esc: usize, id: ParamId, value: f32) -> Result<(), Refused> {
        let name = id.entry().name;
        let frame = set_frame(id, value);
        // Separate from the program's own stream, which may be in the middle of a frame.
        let stream = self.new_stream();
        self.rack
            .receive_for(esc, stream, frame.raw_bytes(), &mut self.look);
        self.rack.forget(stream);
        if self.param(esc, id) == value {
            return Ok(());
        }
        let device = self.esc(esc);
        let bench = device.rig().around().bench();
        let board = bench.sensing.board(bench.delay);
        let mut wanted = device.esc().params().clone();
        // It is in range.
        let _ = wanted.set(id, value);
        let reason = if device.rig().is_held() {
            "the chip is in reset"
        } else if let Some(reason) = id.beyond(value, &board) {
            reason
        } else if !id.entry().live {
            "the motor turns"
        } else if let Err(error) = esc::check(&wanted, &board) {
            error.reason
        } else {
            "the ESC takes signed commands only"
        };
        Err(Refused {
            name,
            value,
            reason,
        })
    }
}
