//! Position observers: from voltages and currents to the rotor's angle and speed.

pub mod back_emf;

use crate::units::{InverseFlux, Speed};

/// What the observer says at a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// ω̂: the step of θ̂.
    pub omega: Speed,
    /// ω̄̂: the speed without the term that passes the noise.
    pub omega_bar: Speed,
    /// The change of ω̄̂ in a period.
    pub omega_bar_step: Speed,
    /// ξ̂, the inverse of the flux.
    pub xi: InverseFlux,
    /// Change of ξ̂ in this period.
    pub xi_step: InverseFlux,
}
