//! A drive for a motor that the parameters do not describe.

use siskin_params::choice::{CtlDrive, CtlMode};
use siskin_params::{BOSSO_MOTOR, Board, ParamId, Params};

use super::over;
use crate::build::build;

fn with(values: &[(ParamId, f32)]) -> Params {
    over(Params::of(&BOSSO_MOTOR), values)
}

fn out_of_the_bag(values: &[(ParamId, f32)]) -> Params {
    over(Params::default(), values)
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
