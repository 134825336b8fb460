//! Current regulators: from the reference current to the voltage.
//!
//! All three take the same [`Reference`] and [`Feedback`], and each holds two integrators. A period is
//! [`Config::voltage`], [`Config::integrate`], and [`Config::anti_windup`] where the modulator's limit cuts
//! something off.

pub mod modified;
pub mod observer_based;
mod reference;
pub mod synchronous;

use siskin_params::parts;
use siskin_units::{Current, Speed, Voltage, WideVoltage, traced, wide};

use super::inductance::Factor;
use super::transform::Dq;
pub use reference::{Feedback, Reference};

/// One of the regulators and its coefficients (`CTL_REGULATOR`).
#[derive(Clone, Debug, PartialEq)]
pub enum Config {
    /// First paper, (10).
    ObserverBased(observer_based::Config, parts::BackEmf),
    /// Second paper, figure 10.
    Synchronous(synchronous::Config),
    /// Second paper, figure 11.
    Modified(modified::Config, parts::Modified),
}

impl Default for Config {
    fn default() -> Self {
        Self::Synchronous(synchronous::Config::default())
    }
}

traced! {
    /// The integrators of all regulators; only the selected one's are in use.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        observer_based: observer_based::State,
        synchronous: synchronous::State,
        modified: modified::State,
    }
}

impl Config {
    /// Returns the voltage that drives the currents to their references, before any limit.
    #[inline(always)] // in each period
    pub fn voltage(&self, state: &State, reference: &Reference, fb: &Feedback) -> Dq<WideVoltage> {
        let u = match self {
            Self::ObserverBased(c, _) => c.voltage(&state.observer_based, reference, fb),
            Self::Synchronous(c) => return c.voltage(&state.synchronous, reference, fb),
            Self::Modified(c, _) => c.voltage(&state.modified, reference, fb),
        };
        Dq {
            d: wide(u.d),
            q: wide(u.q),
        }
    }

    /// Advances the integrators by one period.
    #[inline(always)] // in each period
    pub fn integrate(&self, state: &mut State, reference: &Reference, fb: &Feedback) {
        match self {
            Self::ObserverBased(c, _) => c.integrate(&mut state.observer_based, reference, fb),
            Self::Synchronous(c) => c.integrate(&mut state.synchronous, reference, fb),
            Self::Modified(c, _) => c.integrate(&mut state.modified, reference, fb),
        }
    }

    /// Corrects [`Config::integrate`] for the voltage that the limit cut off. The integrators continue as if only the
    /// current within reach of the remaining voltage had been demanded, so they respond at once when the demand falls.
    pub fn anti_windup(&self, state: &mut State, cut: Dq<WideVoltage>) {
        match self {
            Self::ObserverBased(c, _) => c.anti_windup(&mut state.observer_based, cut),
            Self::Synchronous(c) => c.anti_windup(&mut state.synchronous, cut),
            Self::Modified(c, _) => c.anti_windup(&mut state.modified, cut),
        }
    }

    /// Returns the i_q* at which [`Config::voltage`] gives `u_q` along q (for the modified regulator, the
    /// voltage's length), whatever i_q* `reference` has.
    ///
    /// Regulated this way, the current goes where the voltage takes it, and a bound on i_q* bounds the current,
    /// which reaches it with the regulator's own dynamics.
    #[inline(always)] // in each period
    pub fn current_at(
        &self,
        state: &State,
        reference: &Reference,
        fb: &Feedback,
        u_q: Voltage,
    ) -> Current {
        match self {
            Self::ObserverBased(c, _) => c.current_at(&state.observer_based, reference, fb, u_q),
            Self::Synchronous(c) => c.current_at(&state.synchronous, reference, fb, u_q),
            Self::Modified(c, _) => c.current_at(&state.modified, reference, fb, u_q),
        }
    }

    /// Returns the voltage along q that a current along d induces, ω̂·L·i_d; zero from a regulator that does not know
    /// it.
    pub fn induced(&self, state: &State, i_d: Current) -> Voltage {
        match self {
            Self::Synchronous(_) => state.synchronous.cross.of(i_d).scaled(),
            Self::ObserverBased(..) | Self::Modified(..) => Voltage::ZERO,
        }
    }

    /// Presets the integrators so that [`Config::voltage`] is `u`: a bumpless takeover from whatever applied
    /// that voltage.
    ///
    /// The modified regulator takes over within a quarter turn of the q axis, with either sign.
    pub fn preset(&self, state: &mut State, u: Dq<Voltage>, reference: &Reference, fb: &Feedback) {
        match self {
            Self::ObserverBased(c, _) => c.preset(&mut state.observer_based, u, reference, fb),
            Self::Synchronous(c) => c.preset(&mut state.synchronous, u, reference, fb),
            Self::Modified(c, _) => c.preset(&mut state.modified, u, reference, fb),
        }
    }

    /// Updates the speed-dependent coefficients, every few periods.
    pub fn schedule_gains(&self, state: &mut State, omega: Speed, inductance: Factor) {
        if let Self::Synchronous(c) = self {
            c.schedule_gains(&mut state.synchronous, omega, inductance);
        }
    }
}
