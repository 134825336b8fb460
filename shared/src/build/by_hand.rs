//! Coefficients checked against figures worked out by hand for a 5-inch racing motor.
//!
//! By [`FromMotor`](siskin_params::FromMotor)'s formulas it starts with 8 A, which drop 0.264 V; the dead time takes
//! 4/π·200 ns·48 kHz·20 V, 0.2445 V; at the least speed the back-EMF is 1.5·0.264 V and a quarter of that, 0.4571 V.

use core::f32::consts::TAU;

use siskin_params::choice::{CtlDrive, CtlObsCure, CtlObserver, CtlRegulator};
use siskin_params::{BOSSO_MOTOR, Board, ParamId, Params, RACING};
use siskin_units::{Current, Speed};

use super::si::Si;
use super::tests::over;
use super::{low_speed, observer, outer, sensing, start};
use crate::control::speed::Bounds;
use crate::control::{dead_time, observer as observers, torque};
use crate::drive::Drift;
use crate::drive::config::six_step;

/// Returns what a block makes of that motor with these changes.
fn made<T>(changes: &[(ParamId, f32)], block: impl FnOnce(&Si) -> T) -> T {
    let params = over(over(Params::of(&BOSSO_MOTOR), &RACING), changes);
    block(&Si::new(&params.in_force(), &Board::BENCH, Drift::NONE))
}

fn near(what: &str, got: f32, wanted: f32) {
    assert!(
        (got / wanted - 1.0).abs() < 2e-3,
        "{what}: {got} for {wanted}"
    );
}

/// Returns i_d at standstill, A.
fn bias_a(changes: &[(ParamId, f32)]) -> f32 {
    made(changes, |p| {
        let (i_d, _) = low_speed(p).bounds(limits(p), Speed::ZERO);
        p.scale.amperes(i_d)
    })
}

/// Returns the largest i_q at full speed, in braking and in driving, A.
fn most_a(changes: &[(ParamId, f32)]) -> [f32; 2] {
    made(changes, |p| {
        let (_, bounds) = low_speed(p).bounds(limits(p), Speed::MAX);
        [-bounds.min, bounds.max].map(|i_q| p.scale.amperes(i_q))
    })
}

/// Returns the bounds that `LIM_PHASE_A` alone sets.
fn limits(p: &Si) -> Bounds {
    let limit = p.scale.current_from_a(p.limit_a);
    Bounds {
        min: -limit,
        max: limit,
    }
}

#[test]
fn the_bias_along_d_is_the_greatest_of_three() {
    // 0.3 of 8 A. The ripple is 0.4571 V over 48 kHz·12 µH, 0.79 A, and the back-EMF exceeds the dead time's voltage.
    near("share", bias_a(&[]), 2.4);
    // A ripple of 0.4571 V over 48 kHz·3 µH.
    near("ripple", bias_a(&[(ParamId::MotLUh, 3.0)]), 3.174);
    // A dead time of 1 µs takes 1.2223 V, and the back-EMF is 0.396 V and a quarter of that, 0.7016 V: 0.3 of the
    // difference over 33 mΩ.
    near("hidden", bias_a(&[(ParamId::PwmDeadtimeNs, 1000.0)]), 4.734);
    // Never more than the start's current: 0.4571 V over 48 kHz·1 µH is 9.5 A.
    near("start", bias_a(&[(ParamId::MotLUh, 1.0)]), 8.0);
}

/// φ/L, 26.79 A, bounds i_q in braking, and 1.5 times as much, 40.19 A, in driving.
#[test]
fn a_current_whose_flux_would_hide_the_rotor_s_is_bounded() {
    for (changes, braking, driving) in [
        // 1.5·φ/L is above LIM_PHASE_A.
        (&[][..], 26.79, 40.0),
        (&[(ParamId::MotLUh, 15.0)][..], 21.43, 32.15),
        (&[(ParamId::MotFluxMwb, 0.2)][..], 16.67, 25.0),
        (&[(ParamId::MotRMohm, 66.0)][..], 26.79, 40.0),
        (&[(ParamId::LimPhaseA, 20.0)][..], 20.0, 20.0),
    ] {
        let made = most_a(changes);
        near("braking", made[0], braking);
        near("driving", made[1], driving);
    }
}

#[test]
fn the_published_observer_and_the_sensors_have_no_such_bound() {
    for observer in [CtlObserver::BackEmf, CtlObserver::Hall] {
        let made = most_a(&[(ParamId::MotLUh, 24.0), observer.setting()]);
        for most in made {
            near("limit", most, 40.0);
        }
    }
    // The cured one has.
    let cured = [CtlObserver::BackEmf.setting(), CtlObsCure::Cured.setting()];
    let [braking, driving] = most_a(&[&[(ParamId::MotLUh, 24.0)], &cured[..]].concat());
    near("braking", braking, 13.4);
    near("driving", driving, 20.09);
}

/// Returns the slew of i_q, and the growth of a driving one, A/s.
fn rates_a_s(changes: &[(ParamId, f32)]) -> [f32; 2] {
    made(changes, |p| {
        let mut place = torque::Config::default();
        outer::torque(p, &mut place);
        [place.slew, place.growth].map(|step| p.scale.amperes(step) / p.outer_t)
    })
}

/// 40 A take 3 ms, and in driving φ/L takes 8 ms.
#[test]
fn a_driving_current_grows_by_the_rotor_s_flux_in_8_ms() {
    for (changes, slew, growth) in [
        (&[][..], 13_333.0, 3349.0),
        (&[(ParamId::MotLUh, 24.0)][..], 13_333.0, 1674.5),
        (&[(ParamId::MotFluxMwb, 0.643)][..], 13_333.0, 6698.0),
        (&[(ParamId::MotRMohm, 66.0)][..], 13_333.0, 3349.0),
        // Never faster than the slew: 6 A in 3 ms, and four times as long with the modified regulator.
        (&[(ParamId::LimPhaseA, 6.0)][..], 2000.0, 2000.0),
        (&[CtlRegulator::Modified.setting()][..], 3333.0, 3333.0),
        // Not limited with sensors, nor with the published observer; with the cured one it is.
        (&[CtlObserver::Hall.setting()][..], 13_333.0, 13_333.0),
        (&[CtlObserver::BackEmf.setting()][..], 13_333.0, 13_333.0),
        (
            &[CtlObserver::BackEmf.setting(), CtlObsCure::Cured.setting()][..],
            13_333.0,
            3349.0,
        ),
    ] {
        let made = rates_a_s(changes);
        near("slew", made[0], slew);
        near("growth", made[1], growth);
    }
}

#[test]
fn the_compensation_is_the_dead_time_s_share_and_the_diodes() {
    // 200 ns of 48 kHz, 0.0096, plus 1.4 V in 20 V of that.
    let duty = made(&[], |p| {
        let mut place = dead_time::Config::default();
        sensing::dead_time(p, &mut place);
        place.duty.to_num::<f32>()
    });
    near("duty", duty, 0.0096 * 1.07);
}

#[test]
fn the_six_step_bound_looks_towards_zero_by_a_quarter_of_the_limit() {
    let changes = [CtlDrive::SixStep.setting(), (ParamId::LimPhaseA, 8.0)];
    let [lead_a, all_in_s] = made(&changes, |p| {
        let mut place = six_step::Config::default();
        super::six_step::six_step(p, 0.9, &mut place);
        let duty = &place.duty;
        let per_period: f32 = duty.k_b.held(p.scale.current_from_a(20.0)).to_num();
        [p.scale.amperes(duty.lead_to_zero_max), p.t / per_period]
    });
    near("lead", lead_a, 2.0);
    // With 20 A to the bound, which counts where the limit is less.
    near("rate", all_in_s, 1.0 / 320.0);
}

#[test]
fn a_start_may_use_what_takes_the_current_to_its_limit_at_its_end() {
    // 1200 rpm of 7 pole pairs are 879.65 rad/s: 33 mΩ take 1.32 V of 40 A, 12 µH 0.4222 V, and the flux of 0.3215 mWb
    // induces 0.2828 V. Half of the supply is its longest vector.
    let changes = [(ParamId::StaRunRpm, 1200.0)];
    let volts = made(&changes, |p| p.scale.volts(start::bus(p)));
    near("supply", volts, 2.0 * (1.32 + 0.4222 + 0.2828));
}

/// Returns the observer's ω_n that follows `LIM_PHASE_A`, and its greatest, 1/s.
fn omega_n(changes: &[(ParamId, f32)]) -> [f32; 2] {
    made(changes, |p| {
        let mut place = observers::Config::default();
        observer::observer(p, &mut place);
        let observers::Config::Compensated(place) = place else {
            panic!("it is the default");
        };
        let per_s = TAU / p.t;
        // A fifth of the limit asks for all of it.
        let fifth = p.scale.current_from_a(p.limit_a / 5.0);
        let following = place.omega_n_per_current.held(fifth);
        let [following, bound, most] = [following, place.omega_n_following, place.omega_n_max]
            .map(|turns| turns.to_num::<f32>() * per_s);
        near("a fifth", following, bound);
        [bound, most]
    })
}

#[test]
fn the_observer_s_loop_is_as_fast_as_the_rotor_asks() {
    // An ampere gives 1.5·7²·0.3215 mWb over 6.3 µkg·m², 3751 rad/s²; times 2² is 15 004, and times 1/0.35 of φ/R,
    // 9.742 ms, 417.6 1/s.
    let [following, most] = omega_n(&[]);
    near("following", following, 417.6);
    near("most", most, 1000.0);
    // A rotor of 10 g·cm² asks for 94 521 times 27.83 ms; the root of what 40 A accelerate it by is less.
    let [following, most] = omega_n(&[(ParamId::MotJGcm2, 10.0)]);
    near("light", following, 1944.0);
    near("most", most, 1944.0);
    // At 5 g·cm² that root is 2750 1/s; a twentieth of 48 kHz is less.
    let [following, most] = omega_n(&[(ParamId::MotJGcm2, 5.0)]);
    near("lighter", following, 2400.0);
    near("most", most, 2400.0);
}

#[test]
fn the_compensation_is_whole_from_a_current_that_the_supply_makes_in_a_dead_time() {
    // 0.6 of 20 V·200 ns over 12 µH is 0.2 A; without a dead time it is one count of the converter.
    let certain_a = |changes: &[(ParamId, f32)]| {
        made(changes, |p| {
            let mut place = dead_time::Config::default();
            sensing::dead_time(p, &mut place);
            let certainty = place.certainty.apply(Current::from_num(0.01));
            0.01 / certainty.to_num::<f32>() * p.unit_a
        })
    };
    near("certain", certain_a(&[]), 0.2);
    let count_a = Board::BENCH.current_a_per_count;
    near(
        "least",
        certain_a(&[(ParamId::PwmDeadtimeNs, 0.0)]),
        count_a,
    );
}
