//! The six-step drive: from the sample to the bridge by zero crossings.
//!
//! It has the phases of the field-oriented drive. Park holds the rotor along one phase and then
//! along another, so that a rotor opposite to the first does not stay there. Ramp begins with the
//! rotor at rest there, or at the forward end of its swing. While the rotor cannot be seen, Ramp
//! commutates at a speed that grows by `STA_RAMP_RPM_S`; crossings correct it as soon as they
//! appear. Run begins after a full turn of consecutive crossings at `STA_RUN_RPM`.
//!
//! Files, each after those it uses: `state`, `duty`, `telemetry`, `outer`, `given`, `start`, `period`.

mod duty;
pub(super) mod given;
mod outer;
pub(super) mod period;
mod start;
pub(super) mod state;
mod telemetry;

#[cfg(test)]
mod tests;
