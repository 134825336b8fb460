//! What every current regulator is given: reference and feedback, and how it takes back what the limit cut off.

use crate::control::inductance::Factor;
use crate::control::transform::Dq;
use crate::math::Gain;
use crate::trace::traced;
use crate::units::{Current, Speed, Voltage, WideVoltage, narrow};

traced! {
    /// The current that is wanted.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Reference {
        /// i_d* and i_q*.
        pub i: Dq<Current>,
        /// p_q*, its change in a period.
        pub i_q_step: Current,
        /// Voltage along q that the speed's reference alone asks for (second paper, figure 47).
        pub u_q: Voltage,
    }
}

impl Reference {
    /// A current along q that does not change.
    pub fn steady(i_q: Current) -> Self {
        Self {
            i: Dq {
                d: Current::ZERO,
                q: i_q,
            },
            ..Self::default()
        }
    }

    /// This reference with another current along d.
    #[must_use]
    pub fn with_i_d(self, i_d: Current) -> Self {
        Self {
            i: Dq {
                d: i_d,
                q: self.i.q,
            },
            ..self
        }
    }

    /// This reference with another current along q.
    #[must_use]
    pub fn with_i_q(self, i_q: Current) -> Self {
        Self {
            i: Dq {
                d: self.i.d,
                q: i_q,
            },
            ..self
        }
    }
}

/// The regulator's feedback, from the observer and the sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// ω̂, the speed of the frame.
    pub omega: Speed,
    /// Measured currents.
    pub i: Dq<Current>,
    /// Estimated currents; the measured ones where the observer estimates none.
    pub i_hat: Dq<Current>,
    /// Estimated back-EMF; (0, −ω̂·φ̂) where the observer estimates a flux.
    pub h_hat: Dq<WideVoltage>,
    /// L over the inductance that the parameters state.
    pub inductance: Factor,
}

/// The current that the voltage that is cut off would have brought, by the loop's first order.
#[inline(always)] // in the longest period
pub(super) fn beyond(admittance: Gain<Voltage, Current>, cut: Dq<WideVoltage>) -> Dq<Current> {
    Dq {
        d: admittance.saturating_apply(narrow(cut.d)),
        q: admittance.saturating_apply(narrow(cut.q)),
    }
}
