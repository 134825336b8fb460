//! Voltage mode: a share of the full modulation along q, as a flight controller's throttle commands
//! it.
//!
//! The current regulator stays in charge, with the i_q* at which it outputs that voltage. So i_d
//! stays at its reference, and where [`torque::follow`](super::torque::follow) bounds i_q*, the
//! bound overrides the command, in braking too.

use fixed::types::I1F31;

use super::regulator::{self, Feedback, Reference};
use super::transform::Dq;
use crate::math::TopProduct;
use crate::units::{Current, Voltage};

/// Returns the voltage for a share, −1 to 1, of the longest vector the supply allows.
pub fn of_share(share: I1F31, vector_max: Voltage) -> Voltage {
    vector_max.top(share).scaled()
}

/// Returns the reference with the i_q at which the regulator outputs `u_q`.
pub fn reference(
    config: &regulator::Config,
    state: &regulator::State,
    fb: &Feedback,
    i_d: Current,
    u_q: Voltage,
) -> Reference {
    let reference = Reference {
        i: Dq {
            d: i_d,
            q: Current::ZERO,
        },
        ..Reference::default()
    };
    let i_q = config.current_at(state, &reference, fb, u_q);
    reference.with_i_q(i_q)
}
