//! The PWM frequency that follows from a slow motor makes a drive.

use siskin_params::{Board, ParamId, Params};

use super::over;
use crate::build::build;

/// A gimbal's motor of 140 rpm/V, with 7 pole pairs, at 12 V; its ESC measures up to 2 A.
#[test]
fn a_slow_motor_gets_what_the_numbers_allow() {
    let mut params = over(
        Params::default(),
        &[
            (ParamId::MotPolePairs, 7.0),
            (ParamId::MotFluxMwb, 5.6),
            (ParamId::MotRMohm, 6300.0),
            (ParamId::MotLUh, 1750.0),
            (ParamId::MotJGcm2, 80.0),
            (ParamId::LimBusVMax, 14.0),
            (ParamId::LimBusVMin, 9.0),
            (ParamId::LimPhaseA, 1.0),
            (ParamId::CtlRpmMax, 1500.0),
            (ParamId::CtlRpmMin, 0.0),
            (ParamId::PwmFreqHz, 0.0),
        ],
    );
    // 0.8·14 V/(π/2·5.6 mWb/8).
    let hz = params.in_force().get(ParamId::PwmFreqHz);
    assert!((hz - 10_186.0).abs() < 10.0, "{hz}");
    let board = Board {
        current_a_per_count: 2.0 / 2048.0,
        current_range_a: 2.0,
        greatest_phase: Board::greatest_phase(2.0),
        ..Board::BENCH
    };
    build(&params, &board).expect("it makes a drive");
    params.set(ParamId::PwmFreqHz, 24_000.0).expect("in range");
    let error = build(&params, &board).expect_err("too high");
    assert_eq!(error.param, ParamId::PwmFreqHz);
}
