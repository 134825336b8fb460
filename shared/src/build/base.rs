//! The quantities that several blocks share, from the parameters and the board.

use core::cell::Cell;
use core::f32::consts::TAU;

use siskin_params::choice::CtlObserver;
use siskin_params::{Board, FromMotor, ParamId, Params};

use super::si::{SLOW_SHARE, Si, scale_of};
use crate::control::PERIODS;
use crate::drive::Drift;

/// Drop of the two body diodes that carry a phase's current during a period's dead times, V.
const DIODES_V: f32 = 1.4;

impl<'a> Si<'a> {
    /// Takes parameters that are [in force](Params::in_force), of a motor that has drifted from them.
    pub(super) fn new(params: &'a Params, board: &'a Board, drift: Drift) -> Self {
        let get = |id| params.get(id);
        let scale = scale_of(params, board);
        let settings = FromMotor::new(params);
        let (t, pole_pairs) = (scale.period_s, scale.pole_pairs);
        let (unit_a, unit_v) = (scale.current_a, scale.voltage_v);
        let r = get(ParamId::MotRMohm) * 1e-3 * drift.resistance;
        let l = get(ParamId::MotLUh) * 1e-6;
        let limit_a = get(ParamId::LimPhaseA);
        let fastest_rpm = get(ParamId::CtlRpmMax);
        let dead_time_s = get(ParamId::PwmDeadtimeNs) * 1e-9;
        let supply_max_v = get(ParamId::LimBusVMax);
        // At 100 rpm the flux crossings are lost unless part of the dead time's loss remains to damp the current.
        let diodes_v = if params.chosen(CtlObserver::Compensated) {
            DIODES_V
        } else {
            0.0
        };
        let unit_rad_s = TAU / (pole_pairs * t);
        Self {
            params,
            board,
            scale,
            settings,
            r,
            l,
            flux: get(ParamId::MotFluxMwb) * 1e-3 * drift.flux,
            j: get(ParamId::MotJGcm2) * 1e-7,
            r_over_l: r / l,
            limit_a,
            supply_max_v,
            fastest_rpm,
            fastest_rad_s: fastest_rpm * pole_pairs * TAU / 60.0,
            fastest_turns: fastest_rpm * pole_pairs * t / 60.0,
            slow_rpm: SLOW_SHARE * settings.run_rpm.min(settings.least_rpm),
            start_a: settings.ramp_a.min(limit_a),
            current_rad_s: TAU * settings.current_hz,
            speed_rad_s: TAU * settings.speed_hz,
            dead_time_s,
            // During the dead time a phase sits a diode drop beyond the rails, at both ends. The share is taken at the
            // highest supply, where it is least: overcompensation is unstable around zero current.
            dead_share: (diodes_v / supply_max_v + 1.0) * dead_time_s / t,
            t,
            outer_t: PERIODS as f32 * t,
            pole_pairs,
            unit_a,
            unit_v,
            unit_wb: scale.flux_wb(),
            unit_as: unit_a * t,
            unit_rad_s,
            rad_per_unit: TAU / t,
            voltage_per_current: unit_a / unit_v,
            torque_per_speed: unit_rad_s / scale.torque_nm(),
            refused: Cell::new(None),
        }
    }
}
