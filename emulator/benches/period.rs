//! What a control period costs on this machine: the control's step, the plant, and both.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use siskin_control::drive::{self, Bridge, Setpoint, State};
use siskin_control::params::{Params, build};
use siskin_emulator::bench::{LOADS, MOTORS};
use siskin_emulator::plant::{Averaged, inverter};
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

    let mut plant = Averaged::new(MOTORS[0].1, LOADS[0].1, 0.0, 0.0);
    plant.impose(471.0);
    let bridge = Bridge::Duty([0.5, 0.6, 0.4].map(siskin_control::units::Duty::from_num));
    criterion.bench_function("averaged plant, one period", |bencher| {
        bencher.iter(|| {
            for _ in 0..2 {
                let drive = inverter(black_box(bridge), 24.0, plant.currents_a(), 0.012);
                black_box(plant.advance(drive, 24.0, 0.5 / 24_000.0));
            }
        });
    });
}

criterion_group!(period, benches);
criterion_main!(period);
