//! What is built, and what is refused.

mod assumed;
mod preset;
mod pwm;

use siskin_params::{BOSSO_MOTOR, Delay, LeastDeadTime, PwmBound};

use super::*;

/// Returns parameters with these values set.
pub(super) fn over(mut params: Params, values: &[(ParamId, f32)]) -> Params {
    for (id, value) in values {
        params.set(*id, *value).expect("in range");
    }
    params
}

#[test]
fn the_defaults_make_a_drive() {
    build(&Params::of(&BOSSO_MOTOR), &Board::BENCH).expect("the defaults fit the bench");
}

#[test]
fn nothing_stays_of_what_was_in_the_place_before() {
    let others = over(
        Params::of(&BOSSO_MOTOR),
        &[
            (ParamId::CtlObserver, 2.0),
            (ParamId::CtlRegulator, 2.0),
            (ParamId::CtlSpeed, 1.0),
            (ParamId::CtlAdaptL, 1.0),
            (ParamId::CtlDrive, 1.0),
            (ParamId::CtlModulation, 1.0),
            (ParamId::MotDir, 1.0),
            (ParamId::MotStop, 0.0),
            (ParamId::MotToneA, 0.0),
            (ParamId::MotRMohm, 54.0),
            (ParamId::MotLUh, 20.0),
            (ParamId::MotFluxMwb, 1.5),
            (ParamId::Inp3d, 1.0),
            (ParamId::LimPhaseA, 15.0),
            (ParamId::PwmFreqHz, 30_000.0),
            (ParamId::PwmDeadtimeNs, 700.0),
            (ParamId::StaRampA, 3.0),
            (ParamId::StaRunRpm, 400.0),
        ],
    );
    let board = Board {
        shunts: Shunts::Two,
        delay: Delay::Half(parts::Bench::HERE),
        ..Board::BENCH
    };
    let mut place = build(&others, &board).expect("it makes a drive");
    let wanted = build(&Params::of(&BOSSO_MOTOR), &Board::BENCH).expect("the defaults fit");
    build_in(
        &Params::of(&BOSSO_MOTOR),
        &Board::BENCH,
        Drift::NONE,
        &mut place,
    )
    .expect("the defaults fit");
    assert_eq!(place, wanted);
}

#[test]
fn each_parameter_at_its_ends_makes_a_drive_or_a_reason() {
    for id in ParamId::ALL {
        for value in [id.entry().min, id.entry().max] {
            let mut params = Params::of(&BOSSO_MOTOR);
            if params.set(id, value).is_ok()
                && let Err(error) = build(&params, &Board::BENCH)
            {
                assert!(!error.reason.is_empty(), "{}", id.entry().name);
            }
        }
    }
}

#[test]
fn a_dead_time_below_the_boards_is_refused_and_raised_at_the_start() {
    let board = Board {
        least_dead_time: LeastDeadTime {
            ns: 750.0,
            refusal: "below this board's 750 ns",
        },
        ..Board::BENCH
    };
    let mut params = Params::of(&BOSSO_MOTOR);
    for short_ns in [0.0, 500.0, 749.0] {
        params
            .set(ParamId::PwmDeadtimeNs, short_ns)
            .expect("in range");
        let error = build(&params, &board).expect_err("too short");
        assert_eq!(error.param, ParamId::PwmDeadtimeNs);
        assert_eq!(error.reason, "below this board's 750 ns");
    }
    // The emulator's bench takes any.
    params.set(ParamId::PwmDeadtimeNs, 0.0).expect("in range");
    build(&params, &Board::BENCH).expect("an ideal inverter");

    // A chosen value is reported; the table's default, which nobody chose, is not.
    let told = params.fit(&board).expect("it is changed");
    assert_eq!(told, (ParamId::PwmDeadtimeNs, "below this board's 750 ns"));
    assert_eq!(params.get(ParamId::PwmDeadtimeNs), 750.0);
    let mut params = Params::of(&BOSSO_MOTOR);
    assert_eq!(params.fit(&board), None);
    assert_eq!(params.get(ParamId::PwmDeadtimeNs), 750.0);
    build(&params, &board).expect("the board's default");
    // A value that is long enough stays.
    params.set(ParamId::PwmDeadtimeNs, 900.0).expect("in range");
    assert_eq!(params.fit(&board), None);
    assert_eq!(params.get(ParamId::PwmDeadtimeNs), 900.0);
}

#[test]
fn a_pwm_frequency_above_that_of_a_choice_in_force_is_refused() {
    let board = Board {
        pwm_bounds: &[PwmBound {
            choice: (ParamId::CtlObserver, 1.0),
            hz: 30_000.0,
            refusal: "at most 30000 with CTL_OBSERVER 1",
        }],
        ..Board::BENCH
    };
    let of = |settings: &[(ParamId, f32)]| {
        build(&over(Params::of(&BOSSO_MOTOR), settings), &board).err()
    };
    let observed = (ParamId::CtlObserver, 1.0);
    let pwm = |hz| (ParamId::PwmFreqHz, hz);
    assert_eq!(of(&[observed, pwm(30_000.0)]), None);
    let error = of(&[observed, pwm(30_001.0)]).expect("too high");
    assert_eq!(error.param, ParamId::PwmFreqHz);
    assert_eq!(error.reason, "at most 30000 with CTL_OBSERVER 1");
    assert_eq!(of(&[pwm(30_001.0)]), None, "another observer");
    let six_step = (ParamId::CtlDrive, 1.0);
    assert_eq!(
        of(&[observed, six_step, pwm(30_001.0)]),
        None,
        "no observer"
    );
}

#[test]
fn contradictions_are_refused_with_the_parameter() {
    let mut params = Params::of(&BOSSO_MOTOR);
    params.set(ParamId::CtlRpmMin, 7000.0).expect("in range");
    let error = build(&params, &Board::BENCH).expect_err("above the maximum");
    assert_eq!(error.param, ParamId::CtlRpmMin);
}
