//! Input common to all current regulators, reference and feedback, and the current behind a voltage that was
//! cut off.

use siskin_units::math::Gain;
use siskin_units::{Current, Speed, Voltage, WideVoltage, narrow, traced};

use crate::control::inductance::Factor;
use crate::control::transform::Dq;

traced! {
    /// The reference current.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub struct Reference {
        /// i_d* and i_q*.
        pub i: Dq<Current>,
        /// p_q*, its change per period.
        pub i_q_step: Current,
        /// Voltage along q fed forward from the speed reference (second paper, figure 47).
        pub u_q: Voltage,
    }
}

impl Reference {
    /// Creates a constant current along q.
    pub fn steady(i_q: Current) -> Self {
        Self {
            i: Dq {
                d: Current::ZERO,
                q: i_q,
            },
            ..Self::default()
        }
    }

    /// Returns this reference with another current along d.
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

    /// Returns this reference with another current along q.
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
    /// Estimated currents, or the measured ones if the observer estimates none.
    pub i_hat: Dq<Current>,
    /// Estimated back-EMF; (0, −ω̂·φ̂) if the observer estimates a flux.
    pub h_hat: Dq<WideVoltage>,
    /// L over the stated inductance.
    pub inductance: Factor,
}

/// Returns the current that the cut-off voltage would have produced in the first-order loop.
#[inline(always)] // in the longest period
pub(super) fn excess_current(
    admittance: Gain<Voltage, Current>,
    cut: Dq<WideVoltage>,
) -> Dq<Current> {
    Dq {
        d: admittance.held(narrow(cut.d)),
        q: admittance.held(narrow(cut.q)),
    }
}
