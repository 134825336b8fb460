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

/// Share from which the voltage rises faster, so that the whole throttle ends at half more than the supply has: with
/// the flux weakened a motor turns as if it had that. Of the benches the first paper's needs most, 1.25 times.
const FASTER_FROM: I1F31 = I1F31::lit("0.8125");

/// Returns what the end of the throttle's range adds to [`of_share`], with the square of the share beyond.
pub fn beyond(share: I1F31, vector_max: Voltage) -> Voltage {
    let more = share.max(FASTER_FROM) - FASTER_FROM;
    // The whole throttle adds 16·(3/16)², 0.56.
    of_share(more, of_share(more, vector_max)) << 4
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
