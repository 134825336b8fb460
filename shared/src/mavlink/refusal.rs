//! Why a parameter's value is rejected.

use mavlink::dialects::ardupilotmega::MavParamError;
use siskin_params::{ParamId, SetError};

pub(super) const OUT_OF_RANGE: MavParamError = MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE;
pub(super) const NOT_PERMITTED: MavParamError = MavParamError::MAV_PARAM_ERROR_PERMISSION_DENIED;
pub(super) const READ_ONLY: MavParamError = MavParamError::MAV_PARAM_ERROR_READ_ONLY;
pub(super) const WRONG_TYPE: MavParamError = MavParamError::MAV_PARAM_ERROR_TYPE_MISMATCH;

/// Why a value was rejected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refusal {
    /// For the requesting client.
    pub(super) error: MavParamError,
    /// The conflicting parameter, if it is another.
    pub(super) because: Option<ParamId>,
    /// For the user.
    pub(super) reason: &'static str,
}

impl Refusal {
    pub(super) const fn new(error: MavParamError, reason: &'static str) -> Self {
        Self {
            error,
            because: None,
            reason,
        }
    }
}

impl From<SetError> for Refusal {
    fn from(error: SetError) -> Self {
        let (error, reason) = match error {
            SetError::NotFinite => (OUT_OF_RANGE, "not a finite number"),
            SetError::OutOfRange => (OUT_OF_RANGE, "out of range"),
            SetError::NotWhole => (OUT_OF_RANGE, "not a whole number"),
            SetError::ReadOnly => (READ_ONLY, "read-only"),
        };
        Self::new(error, reason)
    }
}
