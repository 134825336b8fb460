//! Voltage mode: a share of the full modulation along q, as a flight controller's throttle.
//!
//! The regulator stays in charge, with the i_q* at which it gives that voltage. So i_d is held at
//! its reference, and where [`torque::follow`](super::torque::follow) bounds i_q*, the bound takes
//! over from the command, in braking as well.

use fixed::types::I1F31;

use super::regulator::{self, Feedback, Reference};
use super::transform::Dq;
use crate::math::TopProduct;
use crate::units::{Current, Voltage};

/// The voltage of a share, −1 to 1, of the longest vector that the supply can give.
pub fn of_share(share: I1F31, vector_max: Voltage) -> Voltage {
    vector_max.top(share).scaled()
}

/// The current at which the regulator gives `u_q`, whatever it is.
pub fn reference(
    config: &regulator::Config,
    state: &regulator::State,
    fb: &Feedback,
    i_d: Current,
    u_q: Voltage,
) -> Reference {
    let wanted = Reference {
        i: Dq {
            d: i_d,
            q: Current::ZERO,
        },
        ..Reference::default()
    };
    let i_q = config.current_at(state, &wanted, fb, u_q);
    wanted.with_i_q(i_q)
}
