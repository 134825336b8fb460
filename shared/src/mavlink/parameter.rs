//! The parameter protocol. Every value is REAL32: no encoding of integers works in every client.

use siskin_params::{ParamId, TABLE};

use super::context::Context;
use super::frame::Address;
use super::frame::Frame;
use super::refusal::{NOT_PERMITTED, OUT_OF_RANGE, Refusal, WRONG_TYPE};
use super::reply::{Replies, Reply};
use super::signing::Trust;

/// `PARAM_REQUEST_READ.param_index` when the name counts.
pub(super) const BY_NAME: i16 = -1;

/// The parameters still to be broadcast for PARAM_REQUEST_LIST.
#[derive(Clone, Debug, Default)]
pub(super) struct List {
    next: usize,
    left: usize,
}

impl List {
    /// Starts a list of all parameters. A request during a list extends it to a whole round: the client gets every
    /// index, and repeated requests cannot hold it up.
    pub(super) fn start(&mut self) {
        self.left = TABLE.len();
    }

    pub(super) fn is_empty(&self) -> bool {
        self.left == 0
    }

    pub(super) fn next(&mut self) -> Option<ParamId> {
        self.left = self.left.checked_sub(1)?;
        let id = ParamId::ALL.get(self.next).copied();
        self.next = (self.next + 1) % TABLE.len();
        id
    }
}

/// Handles PARAM_REQUEST_READ. `alone` if nobody else was addressed: only then is an unknown name an error.
pub(super) fn read(frame: &Frame, alone: bool, replies: &mut Replies) {
    let index = frame.i16(0);
    let name = frame.bytes(4);
    let found = if index == BY_NAME {
        find(&name)
    } else {
        usize::try_from(index)
            .ok()
            .and_then(|index| ParamId::ALL.get(index).copied())
    };
    match found {
        Some(id) => replies.value(id),
        None if alone => unknown(frame.from, name, index, replies),
        None => {}
    }
}

/// Handles PARAM_SET. Returns the parameter if the value was taken; the value in force is broadcast either way.
///
/// The sender's type is ignored: clients that keep integers in floats mean the same number. Those that put an integer's
/// bytes into the float produce a subnormal, which no parameter means.
pub(super) fn set(
    frame: &Frame,
    trust: Trust,
    alone: bool,
    stopped: bool,
    context: &mut Context,
    replies: &mut Replies,
) -> Option<ParamId> {
    let name = frame.bytes(6);
    let Some(id) = find(&name) else {
        if alone {
            unknown(frame.from, name, BY_NAME, replies);
        }
        return None;
    };
    replies.value(id);
    let result = match trust {
        Trust::Full => take(id, frame.f32(0), stopped, context),
        Trust::Read | Trust::None => Err(Refusal::new(NOT_PERMITTED, "it is not signed")),
    };
    if let Err(refusal) = result {
        replies.push(Reply::Refused {
            to: frame.from,
            id,
            refusal,
        });
    }
    result.ok().map(|()| id)
}

fn take(id: ParamId, value: f32, stopped: bool, context: &mut Context) -> Result<(), Refusal> {
    if value.is_subnormal() {
        return Err(Refusal::new(WRONG_TYPE, "send it as REAL32"));
    }
    if !stopped && !id.entry().live {
        let reason = "the motor turns";
        return Err(Refusal::new(NOT_PERMITTED, reason));
    }
    if id.lacks(value) && value != context.params.get(id) {
        let reason = "not in this image";
        return Err(Refusal::new(OUT_OF_RANGE, reason));
    }
    let mut params = context.params.clone();
    params.set(id, value)?;
    if let Some(reason) = id.beyond(value, context.board) {
        return Err(Refusal::new(OUT_OF_RANGE, reason));
    }
    // At rest others may follow that it fits, in any order.
    if !stopped {
        (context.validate)(&params).map_err(|error| Refusal {
            because: Some(error.param).filter(|param| *param != id),
            ..Refusal::new(OUT_OF_RANGE, error.reason)
        })?;
    }
    *context.params = params;
    Ok(())
}

/// Finds a parameter by name; one of 16 characters has no terminating zero.
fn find(name: &[u8; 16]) -> Option<ParamId> {
    let name = name.split(|byte| *byte == 0).next()?;
    ParamId::find_bytes(name)
}

fn unknown(to: Address, name: [u8; 16], index: i16, replies: &mut Replies) {
    replies.push(Reply::UnknownParam { to, name, index });
}
