//! The parameter protocol. Every value is REAL32: no encoding of integers works in every client.

use super::context::Context;
use super::frame::Address;
use super::frame::Frame;
use super::refusal::{NOT_PERMITTED, OUT_OF_RANGE, Refusal, WRONG_TYPE};
use super::reply::{Replies, Reply};
use super::signing::Trust;
use crate::params::{ParamId, TABLE};

/// `PARAM_REQUEST_READ.param_index` when the name counts.
pub(super) const BY_NAME: i16 = -1;

/// The parameters that are still to be broadcast for PARAM_REQUEST_LIST.
#[derive(Clone, Debug, Default)]
pub(super) struct List {
    next: usize,
    left: usize,
}

impl List {
    /// All parameters from here on. A request while a list is under way lengthens it to a whole
    /// round: whoever asked gets every index, and asking again and again cannot hold it up.
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

/// PARAM_REQUEST_READ. `alone` when nobody else was asked: only then is an unknown name an error.
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

/// PARAM_SET. Returns the parameter if the value was taken; the value in force is broadcast either way.
///
/// The type that the sender names is not looked at: those that keep integers in floats mean the
/// same number. Those that put an integer's bytes into the float give a subnormal, which no
/// parameter means.
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
        let reason = "the motor turns; stop it first";
        return Err(Refusal::new(NOT_PERMITTED, reason));
    }
    change(id, value, context)
}

/// Changes a value if it is in its range and makes a drive.
///
/// Never inlined: a command calls it too.
#[inline(never)]
pub(super) fn change(id: ParamId, value: f32, context: &mut Context) -> Result<(), Refusal> {
    let mut params = context.params.clone();
    params.set(id, value)?;
    (context.validate)(&params).map_err(|error| Refusal {
        because: Some(error.param).filter(|param| *param != id),
        ..Refusal::new(OUT_OF_RANGE, error.reason)
    })?;
    *context.params = params;
    Ok(())
}

/// A name of 16 characters has no zero at its end.
fn find(name: &[u8; 16]) -> Option<ParamId> {
    let name = name.split(|byte| *byte == 0).next()?;
    ParamId::find_bytes(name)
}

fn unknown(to: Address, name: [u8; 16], index: i16, replies: &mut Replies) {
    replies.push(Reply::UnknownParam { to, name, index });
}
