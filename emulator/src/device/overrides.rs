//! Parameters from the command line or the bench, which are in force without being stored.

use mavlink::dialects::ardupilotmega::PARAM_SET_DATA;
use mavlink::{MavlinkVersion, MessageData};
use siskin_control::mavlink::Frame;
use siskin_params::{ParamId, Params};

/// All of them, in order of precedence: the last one wins.
pub(super) struct Overrides(Vec<Override>);

/// One of them.
struct Override {
    id: ParamId,
    value: f32,
    /// True if it only replaces the factory value.
    is_default: bool,
    /// The stored value, which stays.
    stored: f32,
    /// True while the value in force is this one because of it. False once somebody has set the parameter, were it to
    /// the same value: then that is what a save stores.
    acts: bool,
    /// True once a value set in its place has been stored: a restart of the ESC finds that one.
    retired: bool,
}

impl Overrides {
    /// Takes those of the bench, which give way to stored values, and those of the command line, which do not. None
    /// acts before [`Overrides::apply`].
    pub(super) fn new(
        defaults: impl IntoIterator<Item = (ParamId, f32)>,
        given: impl IntoIterator<Item = (ParamId, f32)>,
    ) -> Self {
        let defaults = defaults.into_iter().map(|given| (given, true));
        let given = given.into_iter().map(|given| (given, false));
        let all = defaults.chain(given);
        let all = all.map(|((id, value), is_default)| Override {
            id,
            value,
            is_default,
            stored: id.entry().default,
            acts: false,
            retired: false,
        });
        Self(all.collect())
    }

    /// Puts them over the stored values. Each value was accepted before.
    pub(super) fn apply(&mut self, params: &mut Params) {
        for given in &mut self.0 {
            given.stored = params.get(given.id);
        }
        for given in &mut self.0 {
            given.acts = if given.is_default {
                params.is_default(given.id)
            } else {
                !given.retired
            };
            if given.acts {
                let _ = params.set(given.id, given.value);
            }
        }
    }

    /// Puts the stored values back in place of those that act, for a save of the rest.
    pub(super) fn hide(&mut self, params: &mut Params) {
        for given in &mut self.0 {
            // An identification or a stick sets parameters too.
            given.acts &= params.get(given.id) == given.value;
        }
        for given in self.0.iter().filter(|given| given.acts) {
            // It was in range when it was stored.
            let _ = params.set(given.id, given.stored);
        }
    }

    /// Takes note that what was set in place of them is stored now.
    pub(super) fn saved(&mut self, params: &Params) {
        for given in &mut self.0 {
            given.stored = params.get(given.id);
            given.retired |= !given.acts;
        }
    }

    /// Takes note that nothing is stored any more.
    pub(super) fn erased(&mut self) {
        for given in &mut self.0 {
            given.retired = false;
        }
    }

    /// Takes note of what a client has set, once the ESC has handled the frame. These are the values in force.
    pub(super) fn heard(&mut self, frame: &Frame, params: &Params) {
        if frame.id != PARAM_SET_DATA::ID {
            return;
        }
        let Ok(set) = PARAM_SET_DATA::deser(MavlinkVersion::V2, frame.payload) else {
            return;
        };
        for given in &mut self.0 {
            let is_own = set.param_id == given.id.entry().name.into();
            // Otherwise it was refused.
            if is_own && params.get(given.id) == set.param_value {
                given.acts = false;
            }
        }
    }
}
