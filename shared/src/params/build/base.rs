//! The quantities that several blocks share, from the parameters and the board.

use core::cell::Cell;
use core::f32::consts::TAU;

use super::formula::define;
use super::quantity::Quantity;
use super::si::{LINEARISED_SHARE, SLOW_SHARE, Si, scale_of};
use crate::control::PERIODS;
use crate::drive::Drift;
use crate::params::board::Board;
use crate::params::choice::CtlObserver;
use crate::params::from_motor::FromMotor;
use crate::params::table::ParamId;
use crate::params::values::Params;

/// Drop of the two body diodes that carry a phase's current during a period's dead times, V.
const DIODES_V: f32 = 1.4;

/// The quantities taken straight from parameters, with the factor that converts each to SI.
const GIVEN: &[(Quantity, ParamId, f32)] = &[
    (Quantity::PwmHz, ParamId::PwmFreqHz, 1.0),
    (Quantity::DeadTime, ParamId::PwmDeadtimeNs, 1e-9),
    (Quantity::R, ParamId::MotRMohm, 1e-3),
    (Quantity::L, ParamId::MotLUh, 1e-6),
    (Quantity::Flux, ParamId::MotFluxMwb, 1e-3),
    (Quantity::J, ParamId::MotJGcm2, 1e-7),
    (Quantity::LimitA, ParamId::LimPhaseA, 1.0),
    (Quantity::RegenA, ParamId::LimRegenA, 1.0),
    (Quantity::SupplyA, ParamId::LimBusA, 1.0),
    (Quantity::SupplyMinV, ParamId::LimBusVMin, 1.0),
    (Quantity::SupplyMaxV, ParamId::LimBusVMax, 1.0),
    (Quantity::FastestRpm, ParamId::CtlRpmMax, 1.0),
    (Quantity::PropellerA, ParamId::CtlFfA, 1.0),
    (Quantity::ToneA, ParamId::MotToneA, 1.0),
];

impl<'a> Si<'a> {
    /// Takes parameters that are [in force](Params::in_force), of a motor that has drifted from them.
    pub(super) fn new(
        params: &'a Params,
        board: &'a Board,
        drift: Drift,
        quantities: &'a [Cell<f32>; Quantity::COUNT],
    ) -> Self {
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
            quantities,
            formulas: Cell::new(&[]),
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

    /// Sets the quantities shared by several blocks. Separate from [`Si::new`], where the chip would copy them all into
    /// place.
    pub(super) fn prepare(&self, drift: Drift) {
        for (quantity, param, factor) in GIVEN {
            self.set(*quantity, self.params.get(*param) * factor);
        }
        self.set(Quantity::R, self.of(Quantity::R) * drift.resistance);
        self.set(Quantity::Flux, self.of(Quantity::Flux) * drift.flux);
        let from_motor = FromMotor::new(self.params);
        self.set(Quantity::LeastRpm, from_motor.least_rpm);
        self.set(Quantity::SlewRpmS, from_motor.slew_rpm_s);
        self.set(Quantity::CurrentHz, from_motor.current_hz);
        self.set(Quantity::SpeedHz, from_motor.speed_hz);
        self.set(Quantity::ParkAs, from_motor.park_as);
        self.set(Quantity::RampA, from_motor.ramp_a);
        self.set(Quantity::RampRpmS, from_motor.ramp_rpm_s);
        self.set(Quantity::RunRpm, from_motor.run_rpm);
        self.set(Quantity::DeadV, from_motor.dead_v);
        self.set(Quantity::APerCount, self.board.current_a_per_count);
        self.set(Quantity::BusVPerCount, self.board.bus_v_per_count);
        self.set(Quantity::TerminalVPerCount, self.board.terminal_v_per_count);
        self.set(Quantity::RangeA, self.board.current_range_a);
        self.set(Quantity::T, self.scale.period_s);
        self.set(Quantity::UnitA, self.scale.current_a);
        self.set(Quantity::UnitV, self.scale.voltage_v);
        self.set(Quantity::PolePairs, self.scale.pole_pairs);
        // At 100 rpm the flux crossings are lost unless part of the dead time's loss remains to damp the current.
        let follows_flux = self.chosen(CtlObserver::Compensated);
        self.set(Quantity::DiodesV, if follows_flux { DIODES_V } else { 0.0 });
        define!(self, {
            Tau([TAU]),
            UnitWb(UnitV * T),
            UnitPerWb(Tau / UnitWb),
            UnitNm([1.5] * PolePairs * UnitA / UnitPerWb),
            UnitAs(UnitA * T),
            TurnsPerRpm(PolePairs * T / [60.0]),
            RadPerUnit(Tau / T),
            VoltagePerCurrent(UnitA / UnitV),
            CurrentPerVoltage(UnitV / UnitA),
            FluxPerCurrent(UnitA / UnitWb),
            MechanicalT(PolePairs * T),
            UnitRadS(Tau / MechanicalT),
            TorquePerSpeed(UnitRadS / UnitNm),
            OuterT([PERIODS as f32] * T),
            ROverL(R / L),
            CurrentRadS(Tau * CurrentHz),
            SpeedRadS(Tau * SpeedHz),
            LinearisedRadS([LINEARISED_SHARE] * FastestRpm * PolePairs * Tau / [60.0]),
            FastestRadS(FastestRpm * PolePairs * Tau / [60.0]),
            FastestTurns(FastestRpm * PolePairs * T / [60.0]),
            SlowestRpm(RunRpm min LeastRpm),
            SlowRpm([SLOW_SHARE] * SlowestRpm),
            StartA(RampA min LimitA),
            // During the dead time a phase sits a diode drop beyond the rails, at both ends. The share is taken at the
            // highest supply, where it is least: overcompensation is unstable around zero current.
            DeadShare(DiodesV / SupplyMaxV + [1.0] * DeadTime / T),
        });
    }
}
