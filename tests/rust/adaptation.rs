//! Adaptation: the inductance is found while the motor turns.

use std::f64::consts::TAU;

use siskin_control::build::build;
use siskin_control::drive::Setpoint;
use siskin_emulator::rig::{Bench, Rig};
use siskin_params::{BOSSO_BENCH, ParamId, Params};

const RPM: f32 = 4500.0;
const L_UH: f64 = 30.6;

/// Returns the drive's inductance over the true one, after 0.3 s at 4500 rpm from a caught rotor.
fn found_over_true(stated_uh: f32) -> f64 {
    let mut params = Params::of(&BOSSO_BENCH);
    for (id, value) in [
        (ParamId::PwmFreqHz, 15_000.0),
        (ParamId::MotLUh, stated_uh),
        (ParamId::CtlAdaptL, 1.0),
    ] {
        params.set(id, value).expect("in range");
    }
    let bench = Bench {
        initial_rad_s: f64::from(RPM) * TAU / 60.0,
        ..Bench::default()
    };
    let board = bench.sensing.board(bench.delay);
    let mut rig = Rig::new(bench, build(&params, &board).expect("it makes a drive"));
    let setpoint = Setpoint::Speed(rig.config().scale.speed_from_rpm(RPM));
    for _ in 0..(0.3 * 15_000.0) as u32 {
        rig.period(setpoint);
    }
    assert!(rig.snapshot().faults.is_empty());
    let factor: f64 = rig.inductance();
    factor * f64::from(stated_uh) / L_UH
}

#[test]
fn an_inductance_that_is_30_percent_off_is_within_4_percent_after_0_3_s() {
    for stated_uh in [0.7 * L_UH as f32, 1.3 * L_UH as f32] {
        let ratio = found_over_true(stated_uh);
        assert!((ratio - 1.0).abs() < 0.04, "{stated_uh} uH: {ratio}");
    }
}
