//! The six-step drive on synthetic samples. Tests with a motor model cover how it turns one.

use fixed::types::I1F31;
use siskin_params::{BOSSO_BENCH, Board, ParamId, Params};
use siskin_units::{AdcCounts, Current, Duty, Speed};

use crate::build::build;
use crate::control::six_step::commutation::Sector;
use crate::drive::io::in_order;
use crate::drive::{Bridge, Config, Fault, Phase, Sample, Setpoint, State, step};

fn drive(changes: &[(ParamId, f32)]) -> (Config, State) {
    let mut params = Params::of(&BOSSO_BENCH);
    let six_step = [(ParamId::PwmFreqHz, 40_000.0), (ParamId::CtlDrive, 1.0)];
    for (id, value) in six_step.iter().chain(changes) {
        params.set(*id, *value).expect("in range");
    }
    let config = build(&params, &Board::BENCH).expect("it makes a drive");
    let state = State::new(&config);
    (config, state)
}

/// No current, and no voltage except the supply's 24 V.
fn quiet() -> Sample {
    Sample {
        currents: [AdcCounts::ZERO; 3],
        bus: AdcCounts::from_num(1404),
        terminals: [AdcCounts::ZERO; 3],
        hall: 7,
    }
}

fn turn(config: &Config) -> Setpoint {
    Setpoint::Speed(config.scale.speed_from_rpm(3000.0))
}

#[test]
fn nothing_switches_without_a_set_point() {
    let (config, mut state) = drive(&[]);
    let zero = [
        Setpoint::Stop,
        Setpoint::Zero,
        Setpoint::Speed(Speed::ZERO),
        Setpoint::Torque(Current::ZERO),
        Setpoint::Voltage(I1F31::ZERO),
    ];
    for setpoint in zero {
        for _ in 0..100 {
            assert_eq!(step(&config, &mut state, quiet(), setpoint), Bridge::Off);
        }
    }
}

#[test]
fn a_start_seeks_the_rotor_by_two_phases_while_the_third_floats() {
    let (config, mut state) = drive(&[]);
    let mut sextants = std::vec::Vec::new();
    // 256 offset readings and the charge come first; without a crossing the first attempt ends after 0.12 s.
    for _ in 0..5000 {
        let bridge = step(&config, &mut state, quiet(), turn(&config));
        let phase = state.snapshot().phase;
        match bridge {
            Bridge::Off => assert!(matches!(phase, Phase::Sense | Phase::Idle)),
            Bridge::Charge(_) => assert_eq!(phase, Phase::Charge),
            Bridge::Legs(legs) => {
                assert_eq!(phase, Phase::Ramp);
                assert!(legs.contains(&Some(Duty::ZERO)), "{legs:?}");
                let floating = legs.map(|leg| leg.is_none());
                assert_eq!(floating.iter().filter(|floats| **floats).count(), 1);
                match sextants.last_mut() {
                    Some((before, periods)) if *before == floating => *periods += 1,
                    _ => sextants.push((floating, 1)),
                }
            }
            other => panic!("{other:?}"),
        }
    }
    // 4 ms at a falling phase that shows nothing, and 64 ms at a rising one, which cannot show less.
    let lengths: std::vec::Vec<u32> = sextants.iter().map(|(_, periods)| *periods).collect();
    assert!(
        matches!(lengths[..], [2558..=2561, 159..=161, ..]),
        "{lengths:?}"
    );
}

#[test]
fn a_rotor_whose_position_is_told_is_driven_from_where_it_stands() {
    let (config, _) = drive(&[(ParamId::Inp3d, 1.0)]);
    let config = config.with_position_given(siskin_params::parts::Bench::HERE);
    for (sector, backwards) in [(Sector::Ab, false), (Sector::Bc, false), (Sector::Ca, true)] {
        let mut state = State::new(&config);
        let sign = if backwards { -1 } else { 1 };
        let command = Setpoint::Speed(config.scale.speed_from_rpm(3000.0) * sign);
        let mut bridge = Bridge::Off;
        for _ in 0..1_000 {
            // Backwards the control sees phases b and c swapped, and the angle negated.
            let theta = sector.middle();
            let theta = if backwards {
                theta.wrapping_neg()
            } else {
                theta
            };
            state.place(theta, Speed::ZERO);
            bridge = step(&config, &mut state, quiet(), command);
            let phase = state.snapshot().phase;
            assert!(!matches!(phase, Phase::Park | Phase::Ramp));
            if phase == Phase::Run {
                break;
            }
        }
        let Bridge::Legs(legs) = bridge else {
            panic!("{bridge:?}");
        };
        let legs = in_order(backwards, legs);
        assert_eq!(sector.legs(legs).floating, None, "{sector:?}");
        assert_eq!(sector.legs(legs).low, Some(Duty::ZERO), "{sector:?}");
    }
}

#[test]
fn stop_ends_a_start_within_ten_periods() {
    for (stop, bridge) in [(0.0, Bridge::Off), (1.0, Bridge::Brake)] {
        for (periods, phase) in [(100, Phase::Sense), (2000, Phase::Ramp)] {
            let (config, mut state) = drive(&[(ParamId::MotStop, stop)]);
            for _ in 0..periods {
                step(&config, &mut state, quiet(), turn(&config));
            }
            assert_eq!(state.snapshot().phase, phase);
            // Before Ramp the rotor may turn at any speed.
            let bridge = if phase == Phase::Sense {
                Bridge::Off
            } else {
                bridge
            };
            let ended = |_| step(&config, &mut state, quiet(), Setpoint::Stop) == bridge;
            assert!((0..10).any(ended), "{phase:?}");
        }
    }
}

#[test]
fn a_start_without_a_rotor_that_follows_fails_within_a_second_and_ends_in_a_fault() {
    let (config, mut state) = drive(&[]);
    let fail = |state: &mut State| {
        let (mut ramp, mut longest, mut ramps) = (0, 0, 0);
        for _ in 0..160_000 {
            step(&config, state, quiet(), turn(&config));
            if state.snapshot().phase == Phase::Ramp {
                ramps += u32::from(ramp == 0);
                ramp += 1;
            } else {
                ramp = 0;
            }
            longest = longest.max(ramp);
        }
        assert!(longest < 40_000, "{longest}");
        assert!(state.snapshot().faults.contains(Fault::Stuck));
        ramps
    };
    assert_eq!(fail(&mut state), 4);
    // 0.3 s of zero throttle end the fault; the next start has as many attempts.
    for _ in 0..12_100 {
        step(&config, &mut state, quiet(), Setpoint::Zero);
    }
    assert!(state.snapshot().faults.is_empty());
    assert_eq!(fail(&mut state), 4);
}

#[test]
fn fewer_than_four_periods_a_sextant_are_refused() {
    let mut params = Params::of(&BOSSO_BENCH);
    params.set(ParamId::CtlDrive, 1.0).expect("in range");
    params.set(ParamId::PwmFreqHz, 28_000.0).expect("in range");
    let error = build(&params, &Board::BENCH).expect_err("3.9 periods");
    assert_eq!(error.param, ParamId::PwmFreqHz);
    params.set(ParamId::PwmFreqHz, 29_000.0).expect("in range");
    build(&params, &Board::BENCH).expect("4.03 periods");
}

#[test]
fn no_sample_and_no_set_point_makes_it_overflow() {
    // Overflow panics in this build.
    // Noise of this many counts, which trips now and then.
    for (noise_counts, changes) in [
        (
            1000,
            &[(ParamId::LimPhaseA, 27.0), (ParamId::LimBusVMax, 60.0)][..],
        ),
        (
            60,
            &[(ParamId::LimPhaseA, 0.5), (ParamId::StaRampA, 100.0)][..],
        ),
        (
            1000,
            &[(ParamId::StaRampRpmS, 1e6), (ParamId::MotPolePairs, 1.0)][..],
        ),
    ] {
        let (config, mut state) = drive(changes);
        let mut ramped = false;
        let mut noise = 1_u32;
        let mut random = || {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (noise >> 12) as i32
        };
        for period in 0..300_000_u32 {
            let mut counts = |most: i32| AdcCounts::from_num(random() % most);
            let sample = Sample {
                currents: [0, 1, 2]
                    .map(|_| counts(noise_counts) - AdcCounts::from_num(noise_counts / 2)),
                bus: AdcCounts::from_num(1200) + counts(300),
                terminals: [0, 1, 2].map(|_| counts(4096) >> (period / 64 % 9)),
                hall: 7,
            };
            let value = random() << 12;
            let setpoint = match period / 4096 % 6 {
                0 => Setpoint::Speed(Speed::from_bits(value)),
                1 => Setpoint::Torque(Current::from_bits(value)),
                2 => Setpoint::Voltage(I1F31::from_bits(value)),
                3 => Setpoint::Zero,
                _ => turn(&config),
            };
            let bridge = step(&config, &mut state, sample, setpoint);
            let snapshot = state.snapshot();
            let switches = matches!(bridge, Bridge::Legs(_));
            assert!(
                !switches || snapshot.phase.drives(),
                "{changes:?}, {period}"
            );
            ramped |= switches && snapshot.phase == Phase::Ramp;
            if !snapshot.faults.is_empty() {
                state = State::new(&config);
            }
        }
        assert!(ramped, "{changes:?}");
    }
}
