//! Charge: the low sides charge the supplies of the high-side drivers before the phases switch.

use siskin_units::traced;

use super::config::Config;
use super::seen::Seen;
use crate::control::catch::Rotor;

traced! {
    /// State of Charge.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub(super) struct State {
        /// Periods so far.
        periods: u32,
    }
}

impl State {
    /// Begins Charge, shortened if the rotor turns, since it goes unobserved meanwhile.
    pub(super) fn begin(&mut self, config: &Config, rotor: Rotor) {
        self.periods = match rotor {
            Rotor::Turning { .. } => config.charge.spared_periods,
            Rotor::Unknown | Rotor::Standing => 0,
        };
    }
}

/// Runs one period of Charge, in which the rotor keeps turning. Returns the periods since the drivers were charged,
/// from 1.
pub(super) fn period(
    config: &Config,
    state: &mut State,
    rotor: &mut Rotor,
    seen: &mut Seen,
) -> Option<u32> {
    if let Rotor::Turning { theta, omega } = rotor {
        *theta = theta.wrapping_add(omega.over_period());
        seen.angle = *theta;
    }
    state.periods += 1;
    let charged = state.periods.checked_sub(config.charge.periods);
    charged.filter(|periods| *periods > 0)
}
