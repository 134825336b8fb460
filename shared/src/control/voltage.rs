//! Voltage mode: a voltage along q, as a flight controller's throttle commands it. It is a share of the length up to
//! which every phase switches, [`Supply::switched`](super::modulator::Supply::switched); where the flux may be
//! weakened, the end of the throttle's range adds to it.
//!
//! The current regulator stays in charge, with the i_q* at which it outputs that voltage. So i_d
//! stays at its reference, and where [`torque::follow`](super::torque::follow) bounds i_q*, the
//! bound overrides the command, in braking too.

use fixed::types::I1F31;
use siskin_units::math::{Held, TopProduct};
use siskin_units::{Current, Voltage};

use super::regulator::{self, Feedback, Reference};
use super::transform::Dq;

/// Returns the voltage for a share, −1 to 1, of the length up to which every phase switches.
pub fn of_share(share: I1F31, vector_max: Voltage) -> Voltage {
    vector_max.top(share).scaled()
}

/// Share from which the voltage rises faster, so that the whole throttle ends at 1.56 of the length up to which every
/// phase switches: with the flux weakened a motor turns as if the supply had that. Of the benches the first
/// paper's needs most, 1.25 times.
const FASTER_FROM: I1F31 = I1F31::lit("0.8125");

/// Returns what the end of the throttle's range adds to [`of_share`], with the square of the share beyond.
#[inline(never)] // voltage mode alone, and the control's memory is full
pub fn beyond(share: I1F31, vector_max: Voltage) -> Voltage {
    let more = share.max(FASTER_FROM) - FASTER_FROM;
    // The whole throttle adds 16·(3/16)², 0.56.
    of_share(more, of_share(more, vector_max)) << 4
}

/// Returns what is added to the voltage where the rotor turns more slowly than at the least one: the back-EMF that it
/// lacks, so that a loss takes half as much of the speed; with twice that some motors' speed begins to swing.
///
/// Near zero current the dead time's loss is not known well enough to be compensated. At 750 ns and 60 kHz it is 0.9 V,
/// where a 3-inch motor idles at 0.5 V.
#[inline(never)] // voltage mode alone, and the control's memory is full
pub fn lift(least: Voltage, emf: Voltage) -> Voltage {
    // No more than at rest, where a rotor turns backwards; and none where there is no least voltage.
    least.minus(emf).min(least).max(Voltage::ZERO)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rotor_below_the_least_speed_gets_more_voltage() {
        for (least, emf, wanted) in [
            (0.5, 0.5, 0.0),
            (0.5, 0.75, 0.0),
            (0.5, 0.25, 0.25),
            (0.5, -1.0, 0.5),
            (0.0, -1.0, 0.0),
        ] {
            let lift = lift(Voltage::from_num(least), Voltage::from_num(emf));
            assert_eq!(lift, Voltage::from_num(wanted), "{emf}");
        }
    }
}
