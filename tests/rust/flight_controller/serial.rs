//! Serial telemetry as flight controllers read it.

use siskin_control::drive::State;
use siskin_control::esc::Esc;
use siskin_emulator::rig::Bench;
use siskin_params::{ParamId, Params};
use siskin_throttle::dshot::{Frame, Rate, edges};

const TICKS_PER_US: u64 = 170;
const DSHOT600: f32 = 12.0;

/// Betaflight, PX4 and ArduPilot read the first byte as unsigned.
#[test]
fn a_cold_esc_does_not_tell_246_degrees() {
    let mut params = Params::default();
    params.set(ParamId::InpProto, DSHOT600).expect("in range");
    let ticks_hz = TICKS_PER_US as u32 * 1_000_000;
    let bench = Bench::default();
    let board = bench.sensing.board(bench.delay);
    let esc = Esc::new(params, board, ticks_hz, 11_520);
    let (mut esc, mut throttle) = esc.expect("the defaults fit");
    let snapshot = State::new(&esc.config().expect("they fit")).snapshot();
    let asking = Frame {
        value: 0,
        telemetry: true,
    };
    let mut now_us = 0;
    for (temperature_c, told_c) in [(-10.0, 0), (-0.6, 0), (0.6, 1), (25.0, 25), (200.0, 127)] {
        now_us += 10_000;
        esc.poll(&mut throttle, now_us, &snapshot, temperature_c, &mut |_| {});
        let asks = edges(asking.to_bits(), Rate::Dshot600).filter_map(|(at_ns, level)| {
            let at_ticks = now_us * TICKS_PER_US + u64::from(at_ns) * TICKS_PER_US / 1_000;
            throttle.edge(now_us, at_ticks as u32, level)
        });
        let ask = asks.last().expect("it is heard");
        let kiss = throttle.answer(ask, &snapshot).kiss.expect("asked for");
        assert_eq!(kiss[0], told_c, "{temperature_c} °C");
    }
}
