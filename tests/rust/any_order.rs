//! Another motor's parameters, set one by one in any order, are in force in the end, and the motor turns with them.

mod station;

use mavlink::dialects::ardupilotmega::MavCmd;
use proptest::prelude::*;
use proptest::sample::select;
use siskin_emulator::bench::library;
use siskin_emulator::device::Start;
use siskin_emulator::link::LinkId;
use siskin_emulator::parameter::set_frame;
use siskin_emulator::rig::{Bench, Period, Rig};
use siskin_emulator::scenario::stand;
use siskin_params::{ParamId, Params};
use station::{HALF, Station, ZERO};
use toml::Table;

/// Derived, and an order.
const NEVER_SET: [ParamId; 2] = [ParamId::MotKv, ParamId::MotIdentify];

/// A bench of the library, with every parameter that suits it.
fn bench(name: &str) -> (Bench, Params) {
    let standing = stand(name, Table::new()).expect("it is in the library");
    let mut params = Params::default();
    for (id, value) in standing.params {
        params.set(id, value).expect("in range");
    }
    (standing.bench, params)
}

/// Sets all parameters, a millisecond each.
fn load(station: &mut Station, params: &Params, order: &[ParamId]) {
    for id in order {
        let frame = set_frame(*id, params.get(*id));
        let mut nobody = |_: f64, _: &Period, _: &Rig| {};
        let link = LinkId::default();
        station.device.receive(link, frame.raw_bytes(), &mut nobody);
        station.run(1, None);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_bench_follows_any_other_in_any_order(
        names in (select(library::names().collect::<Vec<_>>()), select(library::names().collect::<Vec<_>>())),
        orders in (Just(ParamId::ALL.to_vec()).prop_shuffle(), Just(ParamId::ALL.to_vec()).prop_shuffle()),
    ) {
        let (_, mut before) = bench(names.0);
        let (mut bench, after) = bench(names.1);
        // One of them rolls at the start, and nothing is set then.
        bench.initial_rad_s = 0.0;
        // The board is the second one's, and takes no more than its sensors show, even from the factory.
        let limit = (ParamId::LimPhaseA, after.get(ParamId::LimPhaseA));
        before.set(limit.0, limit.1).expect("in range");
        let mut station = Station::new(Start { bench, defaults: vec![limit], ..Start::default() });
        for (params, mut order) in [(&before, orders.0), (&after, orders.1)] {
            order.retain(|id| !NEVER_SET.contains(id));
            load(&mut station, params, &order);
            prop_assert_eq!(station.device.esc().params(), params, "{:?}", station.texts);
            station.run(1500, None);
            station.ask(MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1.0);
            station.run(1500, None);
            prop_assert_eq!(station.device.esc().params(), params, "a restart finds them");
        }
        station.texts.clear();
        station.run(2000, Some(ZERO));
        prop_assert!(station.device.esc().telemetry().armed, "{:?}", station.texts);
        station.run(1000, Some(HALF));
        prop_assert!(station.rpm > 1.0, "{:?}", station.texts);
    }
}
