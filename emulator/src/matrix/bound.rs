//! What a cell must keep within, and what it exceeds.

use serde::Serialize;

use super::cell::Cell;
use super::row::{Reaction, Row};
use crate::rig::Bench;

/// `LIM_PHASE_A`, A, and `LIM_BUS_V_MAX`, V, of the matrix's bench.
const PHASE_A: f64 = 20.0;
const SUPPLY_V: f64 = 30.0;
/// Winding: insulation of class F. Stage: `LIM_TEMP_C`.
const WINDING_C: f64 = 155.0;
const STAGE_C: f64 = 100.0;

/// Upper limits of what is measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Bounds {
    /// Phase current from 200 µs after the fault on, A: 1.2 times its limit. What the rotor drives through the diodes
    /// is not the ESC's to bound: through a shorted switch at most twice the current of a short circuit of all phases
    /// at its speed, into a supply below its own voltage less than that current.
    pub current_a: f64,
    /// Supply, V: its maximum.
    pub bus_v: f64,
    /// Winding, °C.
    pub winding_c: f64,
    /// Stage, °C.
    pub stage_c: f64,
    /// From the fault to the first reaction or name, ms, where there must be one.
    pub within_ms: Option<f64>,
    /// From a current beyond the comparators' level to gates off, µs, where they must act.
    pub trip_us: Option<f64>,
}

/// What a cell violates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Miss {
    /// Phase current.
    Current,
    /// Supply voltage.
    Supply,
    /// Temperature of the winding.
    Winding,
    /// Temperature of the stage.
    Stage,
    /// Something false is named, or something true is not.
    Cause,
    /// The reaction.
    Reaction,
    /// The reaction time, or that of the comparators.
    Time,
    /// A leg had less than the dead time between its switches.
    Gates,
    /// With the throttle closed and the fault mended, it does not turn again.
    Again,
}

impl Bounds {
    pub(super) fn of(cell: &Cell) -> Self {
        let expected = cell.expected();
        let limit_a = 1.2 * PHASE_A;
        let shorts = match cell.fault {
            Row::HighShort | Row::LowShort => 2.0,
            Row::DeepSag | Row::BrownOut | Row::Disconnect => 1.0,
            _ => 0.0,
        };
        let current_a = limit_a.max(shorts * short_circuit_a(cell.speed_rad_s));
        Self {
            current_a,
            bus_v: SUPPLY_V,
            winding_c: WINDING_C,
            stage_c: STAGE_C,
            within_ms: expected.within_s.map(|s| 1e3 * s),
            trip_us: expected.trip_s.map(|s| 1e6 * s),
        }
    }

    pub(super) fn misses(&self, cell: &Cell) -> Vec<Miss> {
        let expected = cell.expected();
        let is_cause = |named: &String| {
            let mut causes = expected.causes.iter();
            causes.any(|cause| named.starts_with(cause))
        };
        let unnamed = expected.named && !cell.named.iter().any(is_cause);
        let misses = [
            (Miss::Current, cell.current_a >= self.current_a),
            (Miss::Supply, cell.bus_v >= self.bus_v),
            (Miss::Winding, cell.winding_c >= self.winding_c),
            (Miss::Stage, cell.stage_c >= self.stage_c),
            (Miss::Cause, unnamed || !cell.named.iter().all(is_cause)),
            (
                Miss::Reaction,
                cell.reaction == Reaction::Fails || !expected.reactions.contains(&cell.reaction),
            ),
            (
                Miss::Time,
                is_late(cell.after_ms, self.within_ms) || is_late(cell.trip_us, self.trip_us),
            ),
            (Miss::Gates, cell.crossed),
            (Miss::Again, !cell.again),
        ];
        let missed = misses.into_iter().filter(|(_, missed)| *missed);
        missed.map(|(miss, _)| miss).collect()
    }
}

/// Returns true if something required within a time has not happened.
fn is_late(after: Option<f64>, within: Option<f64>) -> bool {
    within.is_some_and(|within| after.is_none_or(|after| after > within))
}

/// Returns the amplitude of the phase currents with all phases shorted, A.
fn short_circuit_a(speed_rad_s: f64) -> f64 {
    let motor = Bench::default().motor;
    let omega = speed_rad_s * f64::from(motor.pole_pairs);
    let reactance_ohm = omega * motor.inductance_h;
    omega * motor.flux_wb / libm::hypot(motor.resistance_ohm, reactance_ohm)
}
