//! Input and estimate of every observer.

use crate::control::inductance::Factor;
use crate::control::transform::AlphaBeta;
use crate::math::SinCos;
use crate::trace::traced;
use crate::units::{Angle, Current, INVERSE_FLUX_NOMINAL, InverseFlux, Speed, Voltage};

/// Input of an observer at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Currents in the stator's frame at this sample.
    pub i: AlphaBeta<Current>,
    /// Mean voltage in the stator's frame from the last sample to this one.
    pub v: AlphaBeta<Voltage>,
    /// L over the inductance that the parameters state.
    pub inductance: Factor,
    /// Change of the speed's reference in the last period, ω̇*·T_s.
    pub planned: Speed,
    /// Hall sensors, see [`Sample`](crate::drive::Sample).
    pub hall: u8,
    /// True if the phases b and c have changed places in all this.
    pub swapped: bool,
}

/// Estimate of an observer at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// θ̂ at this sample.
    pub theta: Angle,
    /// Its cosine and sine.
    pub frame: SinCos,
    /// ω̂: the step of θ̂ until the next sample.
    pub omega: Speed,
    /// ω̄̂: the speed without the term that passes the noise.
    pub omega_bar: Speed,
}

traced! {
    /// The slower part of the estimate, for work that is not done in every period.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SlowEstimate {
        /// The change of ω̄̂ in a period.
        pub omega_bar_step: Speed,
        /// ξ̂, the inverse of the flux.
        pub xi: InverseFlux,
        /// Change of ξ̂ in a period.
        pub xi_step: InverseFlux,
        /// True if the observer's state is out of its range: the rotor may be elsewhere.
        pub lost: bool,
    }
}

impl Default for SlowEstimate {
    fn default() -> Self {
        Self {
            omega_bar_step: Speed::ZERO,
            xi: INVERSE_FLUX_NOMINAL,
            xi_step: InverseFlux::ZERO,
            lost: false,
        }
    }
}
