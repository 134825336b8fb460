//! The traced channels.

use siskin_control::drive::{Bridge, Direction, Snapshot};
use siskin_units::{Flux, Scale};

use crate::record::Row;
use crate::shaft::Units;
use crate::surroundings::Motion;

/// Number of channels.
pub(super) const COUNT: usize = 25;

/// A control period as left by the simulation. Its values are computed when viewed: recording it must cost next to
/// nothing.
#[derive(Clone, Copy)]
pub(super) struct Point {
    /// Its start, s.
    pub(super) t_s: f64,
    /// The motor.
    pub(super) motion: Motion,
    /// Throttle on the wire, 0 to 1.
    pub(super) throttle: f32,
    /// The control, if accessible.
    pub(super) control: Option<Control>,
}

/// The control in a period.
#[derive(Clone, Copy)]
pub(super) struct Control {
    pub(super) bridge: Bridge,
    pub(super) snapshot: Snapshot,
    pub(super) scale: Scale,
    pub(super) direction: Direction,
    /// λ̂ of the phases, in the control's units.
    pub(super) flux: [Flux; 3],
}

/// Returns the channels' names, with the unit as the last part: those of a recording except time, and some that it
/// lacks.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    let of_row = Row::COLUMNS[1..].iter().copied();
    of_row.chain(["throttle", "flux_a_wb", "flux_b_wb", "flux_c_wb"])
}

/// Returns their values in a control period; unknown ones are NaN.
#[rustfmt::skip]
pub(super) fn values(point: &Point) -> [f32; COUNT] {
    let (row, flux_wb) = match &point.control {
        None => (Row::outside(point.t_s, &point.motion), [f32::NAN; 3]),
        Some(Control { bridge, snapshot, scale, direction, flux }) => {
            let units = Units { scale, direction: *direction };
            let row = Row::seen(point.t_s, (*bridge, &point.motion), (snapshot, units));
            let unit_wb = scale.flux_wb();
            (row, flux.map(|flux| flux.to_num::<f32>() * unit_wb))
        }
    };
    let or = |value: Option<f32>| value.unwrap_or(f32::NAN);
    let number = |value: Option<u8>| value.map_or(f32::NAN, f32::from);
    [
        number(row.phase.map(|phase| phase as u8)), number(row.faults),
        row.rpm, or(row.rpm_est), or(row.rpm_ref),
        row.angle_deg, or(row.angle_est_deg), or(row.angle_error_deg),
        row.i_a_a, row.i_b_a, row.i_c_a, or(row.i_d_a), or(row.i_q_a), or(row.u_d_v), or(row.u_q_v),
        or(row.duty_a), or(row.duty_b), or(row.duty_c), row.bus_v, row.bus_a, row.torque_nm,
        point.throttle, flux_wb[0], flux_wb[1], flux_wb[2],
    ]
}
