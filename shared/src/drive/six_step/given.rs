//! The rotor's position is told: commutation by it from standstill on, without Park, Ramp and
//! crossings.

use fixed::types::{I1F31, I2F30};

use super::duty::take_over;
use super::state::State;
use crate::control::modulator::Supply;
use crate::control::observer;
use crate::control::six_step::commutation::Sector;
use crate::drive::config::Config;
use crate::drive::config::six_step;
use crate::drive::shared::Shared;
use crate::math::TopProduct;
use crate::units::{Angle, Speed, Voltage, stated_emf};

/// Mean back-EMF between two phases within a sextant over a phase's peak: √3·3/π.
const BETWEEN_PHASES: I2F30 = I2F30::lit("1.6539867");

/// The rotor's position and speed as the control sees them, where the drive is told.
pub(in crate::drive) fn position(
    config: &Config,
    observer: &observer::State,
    shared: &Shared,
) -> Option<(Angle, Speed)> {
    (config.observer == observer::Config::Given)
        .then(|| observer.given.seen(shared.swapped(config)))
}

/// Run begins at once, with the duty that the rotor's speed holds up without a current.
pub(super) fn begin(
    config: &Config,
    six_step: &six_step::Config,
    (s, shared): (&mut State, &mut Shared),
    position: (Angle, Speed),
) {
    follow(six_step, (s, shared), position);
    let emf = stated_emf(s.tracking.omega.max(Speed::ZERO));
    let supply = Supply::new(&config.modulator, shared.protection.bus, Voltage::ZERO);
    // 28 + 28 − 32 and 24 + 30 − 32 fraction bits; 31 wanted.
    let share = emf.top(supply.reciprocal).top(BETWEEN_PHASES).to_bits();
    let duty = I1F31::from_bits(share.min((1 << 22) - 1) << 9);
    s.duty.duty = duty.min(six_step.duty.duty_max);
    take_over(s);
}

/// A period: the sextant in the middle of which the command will act, and the rotor's place in it.
pub(super) fn follow(
    six_step: &six_step::Config,
    (s, shared): (&mut State, &mut Shared),
    (theta, omega): (Angle, Speed),
) {
    if omega >= six_step.slow {
        shared.progress.slow_periods = 0;
    }
    s.sector = Sector::at(theta.wrapping_add(six_step.delay.advance(omega)));
    s.tracking.delta = theta.wrapping_sub(s.sector.middle());
    s.tracking.omega = omega;
    s.tracking.omega_bar = omega;
}

/// Run is too slow: it has just begun, or something holds the rotor. True where that has lasted.
pub(super) fn is_stuck(config: &Config, shared: &mut Shared) -> bool {
    shared.progress.slow_periods += 1;
    shared.progress.slow_periods > config.slow_periods
}
