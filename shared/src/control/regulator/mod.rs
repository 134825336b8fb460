//! Current regulators: from the current that is wanted to the voltage.

pub mod observer_based;

use super::transform::Dq;
use crate::units::{Current, Speed, Voltage};

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
}

/// What the regulator reads of the observer and of the sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback {
    /// ω̂, the speed of the frame.
    pub omega: Speed,
    /// Measured currents.
    pub i: Dq<Current>,
    /// Estimated currents.
    pub i_hat: Dq<Current>,
    /// Estimated back-EMF.
    pub h_hat: Dq<Voltage>,
}
