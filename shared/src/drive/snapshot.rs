//! A copy of the control's state variables for the tasks.

use siskin_units::{AdcCounts, Angle, Current, Flux, Speed, Voltage};

use super::phase::Phase;
use crate::control::speed::Bounds;
use crate::control::transform::Dq;
use crate::protection::Faults;

/// The control's state variables for the tasks, copied out of the interrupt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// The drive's phase in the last period.
    pub phase: Phase,
    /// Faults that hold the bridge off.
    pub faults: Faults,
    /// Faults that turned the bridge off since power-up.
    pub fault_count: u32,
    /// Electrical angle of the control's frame at the sample, for the phase order a, b, c: the rotor's estimate in
    /// Run and Stopping, imposed in Park and Ramp.
    pub angle: Angle,
    /// Estimated electrical speed, negative against the configured direction.
    pub speed: Speed,
    /// Reference for the electrical speed.
    pub speed_reference: Speed,
    /// Measured current in the estimated rotor's frame.
    pub i: Dq<Current>,
    /// i_q*; with the six-step drive, which regulates no current, zero.
    pub i_q_reference: Current,
    /// Commanded voltage.
    pub u: Dq<Voltage>,
    /// Flux of the rotor as the default observer sees it; the stated one with any other.
    pub flux: Flux,
    /// Readings of the three phase currents, in an order that stays constant while the motor turns: from the last
    /// sample, or with six-step from the end of the last sextant with a crossing.
    pub currents: [AdcCounts; 3],
    /// Supply voltage.
    pub bus: Voltage,
    /// Current from the supply, 1.5·(v·i)/V_bus; negative while braking.
    pub bus_current: Current,
    /// Bounds of i_q*, as moved by the supply.
    pub bounds: Bounds,
    /// Trip level of a phase current reading.
    pub trip: AdcCounts,
    /// A position sensor has failed.
    pub sensor_fault: bool,
    /// Failed attempts of the present start.
    pub failed_starts: u8,
    /// Consecutive periods with the observer's state out of range.
    pub lost_periods: u32,
    /// Consecutive sextants in which the driving six-step drive saw no crossing.
    pub missed_sextants: u8,
}
