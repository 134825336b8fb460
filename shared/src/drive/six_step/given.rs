//! Commutation by a given rotor position, from standstill, without Park, Ramp and crossings.

use fixed::types::{I1F31, I2F30};
use siskin_params::parts::Bench;
use siskin_units::math::TopProduct;
use siskin_units::{Angle, Speed, Voltage, stated_emf};

use super::duty::take_over;
use super::state::State;
use crate::control::modulator::Supply;
use crate::control::observer;
use crate::control::six_step::commutation::Sector;
use crate::drive::config::Config;
use crate::drive::config::six_step;
use crate::drive::shared::Shared;

/// Mean back-EMF between two phases over a sextant, relative to a phase's peak: √3·3/π.
const BETWEEN_PHASES: I2F30 = I2F30::lit("1.6539867");

/// The rotor's angle and speed, if they are given.
pub(in crate::drive) type Position = Option<(Angle, Speed, Bench)>;

/// Returns the rotor's position and speed as the control sees them, if they are given.
pub(in crate::drive) fn position(
    config: &Config,
    observer: &observer::State,
    shared: &Shared,
) -> Position {
    match config.observer {
        observer::Config::Given(part) => {
            let (theta, omega) = observer.given.seen(shared.swapped(config));
            Some((theta, omega, part))
        }
        _ => None,
    }
}

/// Begins Run at once, with the duty that sustains the rotor's speed without current.
pub(super) fn begin(
    config: &Config,
    six_step: &six_step::Config,
    (s, shared): (&mut State, &mut Shared),
    position: (Angle, Speed, Bench),
) {
    follow(six_step, (s, shared), position);
    let emf = stated_emf(s.tracking.omega.max(Speed::ZERO));
    let supply = Supply::new(&config.modulator, shared.protection.bus, Voltage::ZERO);
    // 28 + 28 − 32 and 24 + 30 − 32 fraction bits; 31 wanted.
    let share = emf.top(supply.reciprocal).top(BETWEEN_PHASES).to_bits();
    let duty = I1F31::from_bits(share.min((1 << 22) - 1) << 9);
    s.duty.duty = duty.min(six_step.duty.duty_max);
    take_over(s, shared.protection.bounds);
}

/// Follows the position: selects the sextant for the middle of the time in which the command acts,
/// and the rotor's place in it.
pub(super) fn follow(
    six_step: &six_step::Config,
    (s, shared): (&mut State, &mut Shared),
    (theta, omega, _): (Angle, Speed, Bench),
) {
    if omega >= six_step.slow {
        shared.progress.slow_periods = 0;
    }
    s.sector = Sector::at(theta.wrapping_add(six_step.delay.advance(omega)));
    s.tracking.delta = theta.wrapping_sub(s.sector.middle());
    s.tracking.omega = omega;
    s.tracking.omega_bar = omega;
}

/// Returns true if Run has been too slow for too long: it has just begun, or something holds the
/// rotor.
pub(super) fn is_stuck(config: &Config, shared: &mut Shared) -> bool {
    shared.progress.slow_periods += 1;
    shared.progress.slow_periods > config.slow_periods
}
