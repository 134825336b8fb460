//! Input and estimate of every observer.

use siskin_units::math::SinCos;
use siskin_units::{Angle, Current, INVERSE_FLUX_NOMINAL, InverseFlux, Speed, Voltage, traced};

use crate::control::inductance::Factor;
use crate::control::transform::AlphaBeta;

/// Input to an observer at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input {
    /// Currents in the stator's frame at this sample.
    pub i: AlphaBeta<Current>,
    /// Mean voltage in the stator's frame since the last sample.
    pub v: AlphaBeta<Voltage>,
    /// L over the stated inductance.
    pub inductance: Factor,
    /// Change of the speed reference in the last period, ω̇*·T_s.
    pub reference_step: Speed,
    /// Hall sensors, see [`Sample`](crate::drive::Sample).
    pub hall: u8,
    /// Phases b and c are swapped in all of this.
    pub swapped: bool,
}

/// Output of an observer at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// θ̂ at this sample.
    pub theta: Angle,
    /// Its cosine and sine.
    pub frame: SinCos,
    /// ω̂: the step of θ̂ until the next sample.
    pub omega: Speed,
    /// ω̄̂: the speed without the noisy proportional term.
    pub omega_bar: Speed,
}

traced! {
    /// The slow part of the estimate, for work not done every period.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct SlowEstimate {
        /// Change of ω̄̂ per period.
        pub omega_bar_step: Speed,
        /// ξ̂, the inverse flux.
        pub xi: InverseFlux,
        /// Change of ξ̂ per period.
        pub xi_step: InverseFlux,
        /// The observer's state is out of range: the rotor may be elsewhere.
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
