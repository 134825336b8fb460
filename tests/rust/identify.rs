//! Identification of the motor by command, on the emulated ESC: it finds the motor on the bench, whatever that
//! is; it runs only when a motor may be turned, and sets nothing until asked to.

mod station;

use core::f64::consts::TAU;

use mavlink::dialects::ardupilotmega::{HEARTBEAT_DATA, MavCmd, MavResult, PARAM_SET_DATA};
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use siskin_control::drive::Phase;
use siskin_emulator::bench::library;
use siskin_emulator::device::Start;
use siskin_emulator::scenario::stand;
use siskin_params::ParamId;
use siskin_units::Speed;
use station::{HALF, Station, ZERO};

const IDENTIFY: MavCmd = MavCmd::MAV_CMD_USER_1;
const END: f32 = 0.0;
const BEGIN: f32 = 1.0;
const KEEP: f32 = 2.0;

/// The parameters that are found.
const FOUND: [ParamId; 4] = [
    ParamId::MotRMohm,
    ParamId::MotLUh,
    ParamId::MotFluxMwb,
    ParamId::MotJGcm2,
];

/// The longest that an identification may take, ms.
const LONGEST_MS: u64 = 20_000;

/// Creates an ESC that knows nothing about the motor on its bench, with these parameters.
fn bench(start: Start, params: &[(ParamId, f32)]) -> Station {
    let unknown = FOUND.map(|id| (id, 0.0));
    Station::new(Start {
        overrides: [&unknown[..], params].concat(),
        ..start
    })
}

/// Creates the default bench.
fn default() -> Station {
    bench(Start::default(), &[])
}

fn of_the_library(name: &str) -> Start {
    let standing = stand(name, toml::Table::new()).expect("built in");
    Start {
        bench: standing.bench,
        defaults: standing.params,
        ..Start::default()
    }
}

fn last(station: &Station) -> MavResult {
    station.acks.last().expect("it is acknowledged").0
}

fn found(station: &Station) -> [f32; 4] {
    FOUND.map(|id| station.device.esc().params().get(id))
}

/// Runs a whole identification and keeps its results; returns how it ends.
fn identify(station: &mut Station) -> MavResult {
    station.ask(IDENTIFY, BEGIN);
    for _ in 0..LONGEST_MS / 100 {
        station.run(100, None);
        if last(station) != MavResult::MAV_RESULT_IN_PROGRESS {
            break;
        }
    }
    assert_eq!(found(station), [0.0; 4], "nothing is set before it is kept");
    if last(station) == MavResult::MAV_RESULT_ACCEPTED {
        // Until the shaft stands.
        for _ in 0..120 {
            station.run(500, None);
            station.ask(IDENTIFY, KEEP);
            station.run(10, None);
            if last(station) != MavResult::MAV_RESULT_TEMPORARILY_REJECTED {
                break;
            }
        }
    }
    last(station)
}

/// Returns R, L, flux and inertia of a motor with its load, in the parameters' units.
fn truth(start: &Start) -> [f64; 4] {
    let (motor, load) = (start.bench.motor, start.bench.load);
    [
        1e3 * motor.resistance_ohm,
        1e6 * motor.inductance_h,
        1e3 * motor.flux_wb,
        1e7 * (motor.inertia_kgm2 + load.inertia_kgm2),
    ]
}

/// Returns the relative error of each figure found, next to its bound.
fn errors(station: &Station, truth: [f64; 4]) -> [(f64, f64); 4] {
    let found = found(station).map(f64::from);
    let bounds = [0.03, 0.05, 0.02, 0.1];
    std::array::from_fn(|at| ((found[at] / truth[at] - 1.0).abs(), bounds[at]))
}

fn within(errors: [(f64, f64); 4]) -> bool {
    errors.into_iter().all(|(error, bound)| error < bound)
}

/// A motor of any size with its propeller, supply, limits and PWM.
#[derive(Clone, Copy, Debug)]
struct Drawn {
    supply_v: f64,
    limit_a: f64,
    /// The limit's drop across R, as a share of the supply.
    drop: f64,
    /// L/R, s.
    winding_s: f64,
    /// Electrical speed at which the back-EMF equals the supply, turns per period.
    turns: f64,
    /// Time in which the limit takes the shaft to three quarters of that, s.
    run_up_s: f64,
    pole_pairs: u8,
    pwm_hz: f64,
    dead_time_ns: f64,
    angle_deg: f64,
    seed: u32,
}

fn log(range: core::ops::Range<f64>) -> impl Strategy<Value = f64> {
    (range.start.ln()..range.end.ln()).prop_map(f64::exp)
}

fn drawn() -> impl Strategy<Value = Drawn> {
    let electric = (log(6.0..45.0), log(2.0..100.0), log(0.03..0.15));
    let winding = (log(1.5e-4..8e-4), log(0.02..0.05));
    let shaft = (log(0.024..0.3), 1..=30_u8, -180.0..180.0);
    let pwm = (
        prop_oneof![Just(24e3), Just(48e3)],
        prop_oneof![Just(200.0), Just(300.0), Just(500.0)],
    );
    (electric, winding, shaft, pwm, any::<u32>()).prop_map(
        |(
            (supply_v, limit_a, drop),
            (winding_s, turns),
            (run_up_s, pole_pairs, angle_deg),
            (pwm_hz, dead_time_ns),
            seed,
        )| Drawn {
            supply_v,
            limit_a,
            drop,
            winding_s,
            turns,
            run_up_s,
            pole_pairs,
            pwm_hz,
            dead_time_ns,
            angle_deg,
            seed,
        },
    )
}

impl Drawn {
    fn start(self) -> Start {
        let Self {
            supply_v,
            limit_a,
            angle_deg,
            seed,
            ..
        } = self;
        let phase_v = supply_v / 3f64.sqrt();
        let resistance = (self.drop * phase_v / limit_a).clamp(5e-3, 5.0);
        let inductance = (self.winding_s * resistance).clamp(3e-6, 2e-3);
        let flux = (phase_v / (TAU * self.turns * self.pwm_hz)).clamp(1e-4, 3e-2);
        let pole_pairs = f64::from(self.pole_pairs);
        let rad_s = 0.75 * phase_v / flux / pole_pairs;
        let torque = 1.5 * pole_pairs * flux * limit_a;
        let half_inertia = 0.5 * torque * self.run_up_s / rad_s;
        // There the propeller takes half of the limit's torque.
        let drag = 0.5 * torque / (rad_s * rad_s);
        let range = 2.0 * limit_a;
        let text = format!(
            r#"
            bus = {supply_v}
            adc_range_a = {range}
            initial_angle_deg = {angle_deg}
            seed = {seed}
            motor = {{ name = "drawn", R = {resistance}, L = {inductance}, flux = {flux}, pole_pairs = {pole_pairs}, J = {half_inertia} }}
            load = {{ name = "propeller", c1 = 0.0, c2 = {drag}, J = {half_inertia} }}
            "#
        );
        let given = text.parse().expect("TOML");
        let standing = stand(library::DEFAULT, given).expect("a bench");
        Start {
            bench: standing.bench,
            defaults: Vec::new(),
            ..Start::default()
        }
    }

    fn params(self) -> [(ParamId, f32); 7] {
        [
            (ParamId::MotPolePairs, f32::from(self.pole_pairs)),
            (ParamId::PwmFreqHz, self.pwm_hz as f32),
            (ParamId::PwmDeadtimeNs, self.dead_time_ns as f32),
            (ParamId::LimPhaseA, self.limit_a as f32),
            (ParamId::LimBusVMax, 1.25 * self.supply_v as f32),
            (ParamId::LimBusVMin, 0.6 * self.supply_v as f32),
            (ParamId::MotToneA, 0.0),
        ]
    }
}

/// `PROPTEST_CASES=500` draws more of them, and another `PROPTEST_RNG_SEED` different ones.
#[test]
fn any_motor_is_found_out_within_20_s_or_refused_with_a_reason() {
    let chosen = std::env::var_os("PROPTEST_CASES").is_some();
    let cases = if chosen {
        ProptestConfig::default().cases
    } else {
        40
    };
    let mut runner = TestRunner::new(ProptestConfig::default());
    let (mut accepted, mut near) = (0, 0);
    for _ in 0..cases {
        let drawn = drawn().new_tree(&mut runner).expect("one").current();
        let start = drawn.start();
        let truth = truth(&start);
        let mut station = bench(start, &drawn.params());
        if identify(&mut station) != MavResult::MAV_RESULT_ACCEPTED {
            println!("{drawn:?}: {:?}", station.texts);
            let told = |text: &String| text.starts_with("Not ");
            assert!(
                station.texts.iter().any(told),
                "{drawn:?}: {:?}",
                station.texts
            );
            continue;
        }
        accepted += 1;
        let errors = errors(&station, truth);
        if within(errors) {
            near += 1;
        } else {
            println!("{drawn:?}: {errors:?}");
        }
        assert!(
            errors.iter().all(|(error, _)| *error < 0.5),
            "{drawn:?}: {errors:?}"
        );
    }
    assert!(100 * near >= 95 * cases, "{near} and {accepted} of {cases}");
}

/// Each also turns as it does with the library's figures.
#[test]
fn each_bench_is_found_out_and_flies() {
    // These two carry a rider.
    let ridden = ["scooter", "skateboard"];
    for name in library::names().filter(|name| !ridden.contains(name)) {
        let start = of_the_library(name);
        let truth = truth(&start);
        let mut station = bench(start, &[]);
        let result = identify(&mut station);
        assert_eq!(
            result,
            MavResult::MAV_RESULT_ACCEPTED,
            "{name}: {:?}",
            station.texts
        );
        let errors = errors(&station, truth);
        assert!(within(errors), "{name}: {errors:?}");
        station.run(500, Some(ZERO));
        station.texts.clear();
        station.run(3000, Some(HALF));
        assert!(station.texts.is_empty(), "{name}: {:?}", station.texts);
        let esc = station.device.esc();
        assert_eq!(esc.telemetry().phase, Phase::Run, "{name}");
    }
}

/// STATUSTEXT has room for 50 characters.
#[test]
fn a_reason_longer_than_a_text_comes_whole_in_two() {
    // The slow motor's flux is too high for it.
    let fast = [(ParamId::PwmFreqHz, 24_000.0)];
    let mut station = bench(of_the_library("gimbal"), &fast);
    assert_eq!(identify(&mut station), MavResult::MAV_RESULT_FAILED);
    let [.., of_parameter, first, rest] = &station.texts[..] else {
        panic!("{:?}", station.texts);
    };
    let whole = "PWM_FREQ_HZ: too high for flux and LIM_BUS_V_MAX";
    assert_eq!(of_parameter, whole);
    let said = format!("{first}{rest}");
    assert_eq!(said, "Not identified: too high for flux and LIM_BUS_V_MAX");
}

#[test]
fn it_ends_by_command_by_disarming_and_by_the_throttle_and_sets_nothing() {
    let disarm = MavCmd::MAV_CMD_COMPONENT_ARM_DISARM;
    for ends in [Some((IDENTIFY, END)), Some((disarm, 0.0)), None] {
        // While the windings are excited, and while the motor turns.
        for turns in [false, true] {
            let mut station = default();
            let is_turning =
                |station: &Station| station.device.rig().snapshot().speed != Speed::ZERO;
            station.run(500, Some(ZERO));
            station.ask(IDENTIFY, BEGIN);
            station.run(1000, Some(ZERO));
            for _ in 0..100 {
                if is_turning(&station) == turns {
                    break;
                }
                station.run(100, Some(ZERO));
            }
            assert_eq!(is_turning(&station), turns);
            assert_eq!(last(&station), MavResult::MAV_RESULT_IN_PROGRESS);
            let (throttle, reason) = match ends {
                Some((command, param)) => {
                    station.ask(command, param);
                    (ZERO, "Not identified: cancelled")
                }
                None => (HALF, "Not identified: the throttle is open"),
            };
            station.run(20, Some(throttle));
            let results: Vec<_> = station.acks.iter().map(|(result, _)| *result).collect();
            assert!(
                results.contains(&MavResult::MAV_RESULT_FAILED),
                "{results:?}"
            );
            assert!(
                station.texts.iter().any(|text| text == reason),
                "{:?}",
                station.texts
            );
            // The throttle turns whatever is on the bench, as before.
            station.run(5000, Some(throttle));
            let turning = station.device.rig().snapshot().phase == Phase::Run;
            assert_eq!(turning, throttle == HALF);
            assert_eq!(found(&station), [0.0; 4]);
            // Nothing has been found, so there is nothing to keep.
            station.texts.clear();
            station.run(3000, Some(ZERO));
            station.ask(IDENTIFY, KEEP);
            station.run(10, Some(ZERO));
            assert_eq!(last(&station), MavResult::MAV_RESULT_FAILED);
            assert_eq!(station.texts, ["Not kept: nothing is identified"]);
        }
    }
}

#[test]
fn it_ends_when_the_client_that_began_it_is_gone() {
    for (beats, ends) in [(5, true), (0, false)] {
        let mut station = default();
        station.ask(IDENTIFY, BEGIN);
        for _ in 0..beats {
            station.send(&HEARTBEAT_DATA::default());
            station.run(1_000, None);
            assert_eq!(last(&station), MavResult::MAV_RESULT_IN_PROGRESS);
        }
        // One that never sent any cannot be missed.
        station.run(2_700, None);
        let ended = has_said(&station, "Not identified: its client is gone");
        assert_eq!(ended, ends);
        assert_eq!(last(&station) == MavResult::MAV_RESULT_FAILED, ends);
        if ends {
            let phase = station.device.rig().snapshot().phase;
            assert!(matches!(phase, Phase::Idle | Phase::Brake), "{phase:?}");
        }
    }
}

/// Writes MOT_IDENTIFY.
fn write(station: &mut Station, value: f32) {
    station.send(&PARAM_SET_DATA {
        param_value: value,
        target_system: 1,
        target_component: 1,
        param_id: ParamId::MotIdentify.entry().name.into(),
        ..PARAM_SET_DATA::default()
    });
}

/// Holds the stick by servo pulses of `width_us` for `for_ms`.
fn hold(station: &mut Station, for_ms: u64, width_us: u32) {
    for _ in 0..for_ms / 20 {
        let now_ns = station.device.now_ns();
        let [a, b, c, d] = (1000 * width_us).to_le_bytes();
        let wire = station.device.wire();
        wire.play(now_ns, &[1, a, b, c, d]).expect("there is room");
        station.run(20, None);
    }
}

fn order(station: &Station) -> f32 {
    station.device.esc().params().get(ParamId::MotIdentify)
}

fn has_said(station: &Station, text: &str) -> bool {
    station.texts.iter().any(|said| said == text)
}

fn asserts_found(station: &Station) {
    let errors = errors(station, truth(&Start::default()));
    assert!(within(errors), "{errors:?}, {:?}", station.texts);
}

#[test]
fn a_parameter_begins_it_ends_it_and_keeps_what_it_has_found() {
    let mut station = default();
    station.run(500, Some(ZERO));
    for (value, text) in [
        (BEGIN, "Identification: phase A"),
        (END, "Not identified: cancelled"),
        (KEEP, "Not kept: nothing is identified"),
        (BEGIN, "Identification: phase A"),
    ] {
        station.texts.clear();
        write(&mut station, value);
        station.run(200, Some(ZERO));
        let under_way = if value == BEGIN { BEGIN } else { 0.0 };
        assert_eq!(order(&station), under_way);
        assert!(has_said(&station, text), "{text}: {:?}", station.texts);
    }
    station.run(LONGEST_MS, Some(ZERO));
    for step in ["phase C", "spinning", "running up", "running down", "done"] {
        let text = format!("Identification: {step}");
        assert!(has_said(&station, &text), "{text}: {:?}", station.texts);
    }
    assert_eq!(
        found(&station),
        [0.0; 4],
        "nothing is set before it is kept"
    );
    write(&mut station, KEEP);
    station.run(200, Some(ZERO));
    asserts_found(&station);
    assert_eq!(order(&station), 0.0);
    // Nor does it begin while the motor turns.
    station.run(3000, Some(HALF));
    write(&mut station, BEGIN);
    station.run(20, Some(HALF));
    assert!(has_said(&station, "Not now: the motor turns"));
    assert_eq!(order(&station), 0.0);
    let phase = station.device.rig().snapshot().phase;
    assert_eq!(phase, Phase::Run);
}

#[test]
fn the_stick_begins_it_and_what_is_found_is_kept() {
    let mut station = default();
    for _ in 0..2 {
        hold(&mut station, 3000, 1900);
        assert_eq!(station.rpm, 0.0);
        hold(&mut station, 1800, 1100);
    }
    assert!(has_said(&station, "Identification: phase A"));
    hold(&mut station, LONGEST_MS, 1100);
    assert!(has_said(&station, "Identification: done"));
    asserts_found(&station);
    station.texts.clear();
    hold(&mut station, 3000, 1500);
    assert!(station.texts.is_empty(), "{:?}", station.texts);
    let phase = station.device.rig().snapshot().phase;
    assert_eq!(phase, Phase::Run);
}

#[test]
fn it_is_begun_at_rest_alone() {
    let mut station = default();
    station.run(500, Some(ZERO));
    station.run(3000, Some(HALF));
    let rpm = station.rpm;
    station.ask(IDENTIFY, BEGIN);
    station.run(100, Some(HALF));
    assert_eq!(last(&station), MavResult::MAV_RESULT_TEMPORARILY_REJECTED);
    assert!(station.rpm < 1.1 * rpm && station.pulls == 0);
}
