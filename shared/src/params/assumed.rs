//! The motor assumed where the parameters do not describe it.
//!
//! Its full speed at `LIM_BUS_V_MAX` is the fastest that six-step follows at this PWM frequency, so every unit and
//! coefficient fits the supply, the PWM and the limit, whatever the motor.

use core::f32::consts::TAU;

use siskin_units::math::SQRT_3;

use super::choice::{CtlDrive, CtlMode};
use super::table::{Choice, ParamId};
use super::values::Params;

/// Pole pairs of most small motors: 12 slots, 14 magnets.
pub(crate) const POLE_PAIRS: f32 = 7.0;

/// PWM periods per electrical turn at full speed: just over the four per sextant that six-step needs.
const TURN_PERIODS: f32 = 25.0;

/// Drop of `LIM_PHASE_A` across R over the supply/√3: 0.05 to 0.15 for motors that the limit suits.
const DROP_SHARE: f32 = 0.1;

/// L/R, s: 0.15 to 0.8 ms for motors of all sizes.
const WINDING_S: f32 = 0.35e-3;

/// Time in which `LIM_PHASE_A` takes motor and load to full speed without drag, s: 0.04 to 0.34 s from the library's
/// 3-inch motor to the first paper's with its propeller.
const RUN_UP_S: f32 = 0.12;

impl Params {
    /// Returns the first of R, L and flux that is not known: field-oriented control needs all three.
    pub fn unknown(&self) -> Option<ParamId> {
        let needed = [ParamId::MotRMohm, ParamId::MotLUh, ParamId::MotFluxMwb];
        needed.into_iter().find(|id| self.get(*id) == 0.0)
    }

    /// Returns the pole pairs, assumed if they are not known.
    pub(super) fn pole_pairs(&self) -> f32 {
        match self.get(ParamId::MotPolePairs) {
            0.0 => POLE_PAIRS,
            stated => stated,
        }
    }

    /// Returns true if the drive in force is the six-step drive.
    pub(super) fn drives_by_six_step(&self) -> bool {
        match self.choice() {
            CtlDrive::FieldOriented => false,
            CtlDrive::SixStep => true,
            CtlDrive::Automatic => self.unknown().is_some(),
        }
    }

    /// Returns the parameters that a drive is built from: `CTL_DRIVE` is decided, and what is unknown of the motor is
    /// assumed; `PWM_FREQ_HZ` follows from it where it is 0.
    ///
    /// If `CTL_DRIVE` is 2 and R, L or flux is unknown, throttle is a share of the supply and `CTL_RPM_MAX` does not
    /// bind.
    pub fn in_force(&self) -> Self {
        let mut made = self.clone();
        let unknown = self.unknown().is_some();
        let supply_v = self.get(ParamId::LimBusVMax);
        let limit_a = self.get(ParamId::LimPhaseA);
        let pole_pairs = self.pole_pairs();
        made.assume(ParamId::MotPolePairs, pole_pairs);
        made.assume(ParamId::PwmFreqHz, self.pwm_hz());
        if unknown {
            let fastest_hz = made.get(ParamId::PwmFreqHz) / TURN_PERIODS;
            let resistance_ohm = DROP_SHARE / SQRT_3 * supply_v / limit_a;
            made.assume(ParamId::MotRMohm, 1e3 * resistance_ohm);
            made.assume(ParamId::MotLUh, 1e6 * WINDING_S * resistance_ohm);
            let flux_wb = supply_v / (SQRT_3 * TAU * fastest_hz);
            made.assume(ParamId::MotFluxMwb, 1e3 * flux_wb);
            made.assume(ParamId::MotJGcm2, 0.0);
            if self.chosen(CtlDrive::Automatic) {
                made.assume(CtlMode::PARAM, f32::from(CtlMode::Voltage.number()));
                made.assume(ParamId::CtlRpmMax, 60.0 * fastest_hz / pole_pairs);
                made.assume(ParamId::CtlRpmMin, 0.0);
            }
        }
        if made.get(ParamId::MotJGcm2) == 0.0 {
            let linkage_wb = 1e-3 * pole_pairs * made.get(ParamId::MotFluxMwb);
            // J = torque times time over the speed at which the back-EMF equals the supply.
            let torque_nm = 1.5 * linkage_wb * limit_a;
            let fastest_rad_s = supply_v / (SQRT_3 * linkage_wb);
            let inertia_kgm2 = RUN_UP_S * torque_nm / fastest_rad_s;
            made.assume(ParamId::MotJGcm2, 1e7 * inertia_kgm2);
        }
        if self.chosen(CtlDrive::Automatic) {
            let drive = if self.drives_by_six_step() {
                CtlDrive::SixStep
            } else {
                CtlDrive::FieldOriented
            };
            made.assume(CtlDrive::PARAM, f32::from(drive.number()));
        }
        made
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::choice::CtlDrive;
    use crate::params::{BOSSO_MOTOR, Board, build};

    fn with(values: &[(ParamId, f32)]) -> Params {
        over(Params::of(&BOSSO_MOTOR), values)
    }

    fn out_of_the_bag(values: &[(ParamId, f32)]) -> Params {
        over(Params::default(), values)
    }

    fn over(mut params: Params, values: &[(ParamId, f32)]) -> Params {
        for (id, value) in values {
            params.set(*id, *value).expect("in range");
        }
        params
    }

    #[test]
    fn without_a_motor_every_supply_limit_and_pwm_makes_a_six_step_drive() {
        let board = Board {
            current_range_a: 300.0,
            greatest_phase: Board::greatest_phase(300.0),
            ..Board::BENCH
        };
        for supply_v in [5.0, 12.6, 60.0] {
            for limit_a in [0.5, 20.0, 200.0] {
                for pwm_hz in [8_000.0, 24_000.0, 60_000.0] {
                    for dead_time_ns in [0.0, 500.0, 1000.0] {
                        for rpm_max in [100.0, 200_000.0] {
                            let params = out_of_the_bag(&[
                                (ParamId::LimBusVMin, 0.5 * supply_v),
                                (ParamId::LimBusVMax, supply_v),
                                (ParamId::LimPhaseA, limit_a),
                                (ParamId::PwmFreqHz, pwm_hz),
                                (ParamId::PwmDeadtimeNs, dead_time_ns),
                                (ParamId::CtlRpmMax, rpm_max),
                            ]);
                            let at = (supply_v, limit_a, pwm_hz, dead_time_ns, rpm_max);
                            let config = build(&params, &board);
                            let config = config.unwrap_or_else(|error| panic!("{at:?}: {error:?}"));
                            assert!(config.six_step.is_some(), "{at:?}");
                            assert!(params.in_force().chosen(CtlMode::Voltage));
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_motor_that_is_known_is_driven_field_oriented_as_if_that_were_chosen() {
        let automatic = with(&[CtlDrive::Automatic.setting()]);
        let chosen = with(&[CtlDrive::FieldOriented.setting()]);
        assert_eq!(automatic.unknown(), None);
        assert_eq!(automatic.in_force(), chosen.in_force());
        assert_eq!(chosen.in_force().get(ParamId::PwmFreqHz), 24_000.0);
        assert!(build(&automatic, &Board::BENCH) == build(&chosen, &Board::BENCH));
    }

    #[test]
    fn one_figure_that_is_missing_makes_it_six_step_and_is_named_to_who_asks_for_another() {
        for missing in [ParamId::MotRMohm, ParamId::MotLUh, ParamId::MotFluxMwb] {
            let automatic = with(&[(missing, 0.0), CtlDrive::Automatic.setting()]);
            let config = build(&automatic, &Board::BENCH).expect("it makes a drive");
            assert!(config.six_step.is_some());
            // What is known of the motor stays.
            assert_eq!(config.scale.pole_pairs, 12.0);
            let asked = with(&[(missing, 0.0), CtlDrive::FieldOriented.setting()]);
            let error = build(&asked, &Board::BENCH).expect_err("not known");
            assert_eq!(error.param, missing);
            assert_eq!(error.reason, "not known; set it, or CTL_DRIVE to 2");
        }
    }

    #[test]
    fn a_six_step_drive_that_was_chosen_keeps_its_mode_and_its_greatest_speed() {
        let params = out_of_the_bag(&[CtlDrive::SixStep.setting()]);
        let made = params.in_force();
        assert!(made.chosen(CtlMode::Speed));
        assert_eq!(made.get(ParamId::CtlRpmMax), 6000.0);
        build(&params, &Board::BENCH).expect("it makes a drive");
    }

    /// 0.12 s of 1.5·12·1.3 mWb·20 A over 30 V/(√3·15.6 mWb): 0.0562 Nms over 1110 rad/s.
    #[test]
    fn an_inertia_that_is_missing_follows_from_the_flux_the_limit_and_the_supply() {
        let params = with(&[(ParamId::MotJGcm2, 0.0), CtlDrive::FieldOriented.setting()]);
        let inertia = params.in_force().get(ParamId::MotJGcm2);
        assert!((inertia / 505.9 - 1.0).abs() < 1e-3, "{inertia}");
        let config = build(&params, &Board::BENCH).expect("it makes a drive");
        assert!(config.six_step.is_none());
    }

    #[test]
    fn pole_pairs_that_are_missing_are_seven_and_without_a_flux_there_is_no_kv() {
        let made = out_of_the_bag(&[]).in_force();
        assert_eq!(made.get(ParamId::MotPolePairs), 7.0);
        let params = with(&[(ParamId::MotFluxMwb, 0.0)]);
        assert_eq!(params.get(ParamId::MotKv), 0.0);
        let params = with(&[(ParamId::MotPolePairs, 0.0)]);
        assert_eq!(params.get(ParamId::MotKv), 0.0);
    }
}
