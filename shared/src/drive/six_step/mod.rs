//! The six-step drive: from the sample to the bridge by zero crossings.
//!
//! It has the phases of the field-oriented drive except Park. Ramp drives a current through two phases wherever the
//! rotor stands, and takes the next two at each crossing, or when there has been none for a while. From half of all
//! angles the rotor turns forwards and crosses; from the others it swings back, by less than half a turn, and as it
//! turns round the back-EMF changes its sign, which is taken for a crossing and is as good as one. Run begins after a full
//! turn of consecutive crossings at `STA_RUN_RPM`.
//!
//! Files, each after those it uses: `state`, `advance`, `duty`, `telemetry`, `outer`, `given`, `start`, `period`.

mod advance;
mod duty;
pub(super) mod given;
mod outer;
pub(super) mod period;
mod start;
pub(super) mod state;
mod telemetry;

#[cfg(test)]
mod tests;
