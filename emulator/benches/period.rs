//! What a control period costs on this machine: the control's step, the plant, and both.

use std::f64::consts::TAU;
use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use siskin_control::drive::{self, Bridge, Setpoint, State};
use siskin_control::params::{Params, build};
use siskin_control::units::Duty;
use siskin_emulator::bench::{LOADS, MOTORS};
use siskin_emulator::plant::{Fidelity, Plant};
use siskin_emulator::rig::{Bench, Rig};

/// The default bench with the shaft at 4500 rpm, settled in field-oriented control.
fn running() -> (Rig, Setpoint) {
    let bench = Bench::default();
    let board = bench.sensing.board(bench.delay);
    let config = build(&Params::default(), &board).expect("the defaults fit");
    let setpoint = Setpoint::Speed(config.scale.speed_from_rpm(4500.0));
    let mut rig = Rig::new(bench, config);
    for _ in 0..60_000 {
        rig.period(setpoint);
    }
    (rig, setpoint)
}

fn benches(criterion: &mut Criterion) {
    let (mut rig, setpoint) = running();
    criterion.bench_function("period: step, plant and sensors", |bencher| {
        bencher.iter(|| rig.period(black_box(setpoint)));
    });

    // The samples of a whole turn, over and over: the state stays in field-oriented control.
    let (mut rig, setpoint) = running();
    let samples: Vec<_> = (0..320).map(|_| rig.period(setpoint).sample).collect();
    let config = rig.config().clone();
    let mut state = State::new(&config);
    let mut next = samples.iter().cycle();
    criterion.bench_function("step", |bencher| {
        bencher.iter(|| {
            let sample = next.next().copied().unwrap_or(samples[0]);
            drive::step(&config, &mut state, black_box(sample), black_box(setpoint))
        });
    });

    for (name, fidelity) in [
        ("averaged plant, one period", Fidelity::Averaged),
        ("switching plant, one period", Fidelity::Switching),
    ] {
        let mut plant = Plant::new(fidelity, MOTORS[0].1, LOADS[0].1, 0.0, 0.0);
        // Three turns in 50 periods: 4500 rpm.
        plant.impose(TAU * 3.0 / 50.0 * 15_000.0 / f64::from(MOTORS[0].1.pole_pairs));
        let duties = commanded();
        let mut next = duties.iter().cycle();
        criterion.bench_function(name, |bencher| {
            bencher.iter(|| {
                let bridge = next.next().copied().unwrap_or(Bridge::Off);
                black_box(plant.period([black_box(bridge); 2], 24.0, 1.0 / 15_000.0, 500e-9))
            });
        });
    }
}

/// What field-oriented control commands at 4500 rpm and 15 kHz, turn after turn: 50 periods are
/// three.
fn commanded() -> Vec<Bridge> {
    (0..50)
        .map(|k| {
            let angle = TAU * 3.0 * f64::from(k + 1) / 50.0;
            let duty = |phase: f64| 0.5 - 0.35 * (angle - TAU * phase / 3.0).sin();
            Bridge::Duty([0.0, 1.0, 2.0].map(|phase| Duty::from_num(duty(phase))))
        })
        .collect()
}

criterion_group!(period, benches);
criterion_main!(period);
