//! The six-step drive: from the sample to what the bridge does, by zero crossings.
//!
//! The phases are those of the field-oriented drive. Park holds the rotor along one phase and then
//! along another, so that one that stood opposite to the first does not stay there. Ramp begins as
//! it stands there, or at the forward end of its swing. While nothing can be seen of the rotor it
//! commutates by a speed that grows by `STA_RAMP_RPM_S`; crossings correct that as soon as there are
//! some. Run begins when a turn of them has been seen in a row at `STA_RUN_RPM`.
//!
//! Files, each above those that it uses: `state`, `duty`, `telemetry`, `given`, `start`, `period`.

mod duty;
pub(super) mod given;
pub(super) mod period;
mod start;
pub(super) mod state;
mod telemetry;

#[cfg(test)]
mod tests;
