//! The rotor's position is told: commutation by it from standstill on, without Park, Ramp and
//! crossings.

use fixed::types::{I1F31, I2F30};

use super::{Config, State, run_from_here};
use crate::control::modulator::Supply;
use crate::control::observer;
use crate::control::six_step::commutation::Sector;
use crate::drive::{self, Fault, Phase};
use crate::math::TopProduct;
use crate::units::{Speed, Voltage, stated_emf};

/// Mean back-EMF between two phases within a sextant over a phase's peak: √3·3/π.
const BETWEEN_PHASES: I2F30 = I2F30::lit("1.6539867");

/// Whether the position is told.
pub(super) fn is_given(config: &drive::Config) -> bool {
    config.observer == observer::Config::Given
}

/// Run begins at once, with the duty that the rotor's speed holds up without a current.
pub(super) fn begin(config: &drive::Config, six_step: &Config, state: &mut drive::State) {
    state.phase = Phase::Run;
    follow(config, six_step, state);
    let s = &mut state.six_step;
    // ω has 32 fraction bits, ξ = 1/4, a voltage 28.
    let emf = stated_emf(s.tracking.omega.max(Speed::ZERO));
    let supply = Supply::new(&config.modulator, state.protection.bus, Voltage::ZERO);
    // 28 + 28 − 32 and 24 + 30 − 32 fraction bits; 31 wanted.
    let share = emf.top(supply.reciprocal).top(BETWEEN_PHASES).to_bits();
    let duty = I1F31::from_bits(share.min((1 << 22) - 1) << 9);
    s.duty.duty = duty.min(six_step.duty.duty_max);
    run_from_here(state);
}

/// A period: the sextant in the middle of which the command will act, and the rotor's place in it.
pub(super) fn follow(config: &drive::Config, six_step: &Config, state: &mut drive::State) {
    let (theta, omega) = state.observer.given.seen(state.swapped(config));
    if omega >= six_step.slow {
        state.slow_periods = 0;
    }
    let State {
        sector, tracking, ..
    } = &mut state.six_step;
    *sector = Sector::at(theta.wrapping_add(six_step.delay.advance(omega)));
    tracking.delta = theta.wrapping_sub(sector.middle());
    tracking.omega = omega;
    tracking.omega_bar = omega;
}

/// Run is too slow: it has just begun, or something holds the rotor.
pub(super) fn slow(config: &drive::Config, state: &mut drive::State) -> bool {
    state.slow_periods += 1;
    let stuck = state.slow_periods > config.slow_periods;
    if stuck {
        state.trip(Fault::Stuck);
    }
    stuck
}
