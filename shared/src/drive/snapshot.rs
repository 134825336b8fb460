//! A copy of the control's figures for the tasks.

use super::phase::Phase;
use crate::control::speed::Bounds;
use crate::control::transform::Dq;
use crate::protection::Faults;
use crate::units::{AdcCounts, Angle, Current, Speed, Voltage};

/// The control's figures for the tasks, copied out of the interrupt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Snapshot {
    /// Phase of the drive in the last period.
    pub phase: Phase,
    /// Faults that hold the bridge off.
    pub faults: Faults,
    /// Faults that have turned the bridge off since the start.
    pub fault_count: u32,
    /// Electrical angle of the control's frame at the sample, with the phases in the order a, b, c:
    /// the rotor's as estimated in Run and Stopping, an imposed one in Park and Ramp.
    pub angle: Angle,
    /// Estimated electrical speed, negative against the configured direction.
    pub speed: Speed,
    /// Reference of the electrical speed.
    pub speed_reference: Speed,
    /// Measured current in the estimated rotor's frame.
    pub i: Dq<Current>,
    /// i_q*; with the six-step drive, which regulates no current, zero.
    pub i_q_reference: Current,
    /// Voltage that was commanded.
    pub u: Dq<Voltage>,
    /// Readings of the three phases' currents, in an order that stays while the motor turns: of the last sample, with
    /// the six-step drive of the end of the last sextant with a crossing.
    pub currents: [AdcCounts; 3],
    /// Supply voltage.
    pub bus: Voltage,
    /// Current from the supply, 1.5·(v·i)/V_bus; negative while braking.
    pub bus_current: Current,
    /// Bounds of i_q*, as the supply has moved them.
    pub bounds: Bounds,
    /// Magnitude of a phase's reading that turns the bridge off.
    pub trip: AdcCounts,
    /// True if a position sensor is at fault.
    pub sensor_fault: bool,
    /// Attempts of the present start that have failed.
    pub failed_starts: u8,
    /// Periods in a row for which the observer's state has been out of its range.
    pub lost_periods: u32,
    /// Sextants in a row in which the six-step drive has seen no crossing where it drives.
    pub missed_sextants: u8,
}
