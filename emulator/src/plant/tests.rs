//! The plant against its equations stepped by brute force, and against invariants.

mod breaks;
mod brute_force;
mod real_motor;

use std::f64::consts::TAU;
use std::sync::LazyLock;

use proptest::prelude::*;
use siskin_control::build::build;
use siskin_control::drive::{Bridge, Setpoint};
use siskin_params::{BOSSO_BENCH, Params};
use siskin_units::Duty;

use super::*;
use crate::fault::InForce;
use crate::rig::{Bench, Rig};
use brute_force::BruteForce;

static MOTOR: LazyLock<Motor> = LazyLock::new(|| Bench::default().motor);

/// 15.15 kHz: a whole number of the brute force's steps.
const PERIOD_S: f64 = 66e-6;

const DEAD_TIME_S: f64 = 500e-9;

fn held(fidelity: Fidelity, rpm: f64, angle_turns: f64) -> Plant {
    let mut plant = Plant::new(fidelity, *MOTOR, Load::default(), 0.0, angle_turns);
    plant.impose(rpm * TAU / 60.0);
    plant
}

/// Returns a duty whose edges are at the brute force's steps.
fn duty(share: f64) -> Duty {
    let steps = 0.5 * PERIOD_S / brute_force::STEP_S;
    Duty::from_num((share * steps).round() / steps)
}

fn duties(duties: [f64; 3]) -> Bridge {
    Bridge::Duty(duties.map(duty))
}

fn legs(legs: [Option<f64>; 3]) -> Bridge {
    Bridge::Legs(legs.map(|leg| leg.map(duty)))
}

/// Returns duties that hold about `amps` of i_q at a speed, from a rotor angle.
fn field_oriented(plant: &Plant, amps: f64, bus_v: f64) -> Bridge {
    let omega = plant.speed_rad_s() * f64::from(MOTOR.pole_pairs);
    let q_v = omega * MOTOR.flux_wb + MOTOR.resistance_ohm * amps;
    let d_v = -omega * MOTOR.inductance_h * amps;
    // To the middle of the period that begins.
    let angle = TAU * plant.angle_turns() + omega * 0.5 * PERIOD_S;
    duties([0.0, 1.0, 2.0].map(|phase: f64| {
        let (sin, cos) = (angle - phase * TAU / 3.0).sin_cos();
        0.5 + (d_v * cos - q_v * sin) / bus_v
    }))
}

/// Runs both from the same start under the commands of `command`, and compares everything.
fn compare(plant: Plant, bus_v: f64, periods: u32, command: impl Fn(u32, &Plant) -> [Bridge; 2]) {
    compare_with(&[], plant, bus_v, periods, command);
}

/// The same for a motor with harmonics.
fn compare_with(
    harmonics: &[Harmonic],
    plant: Plant,
    bus_v: f64,
    periods: u32,
    command: impl Fn(u32, &Plant) -> [Bridge; 2],
) {
    let brute = BruteForce::new(*MOTOR, harmonics, &plant, DEAD_TIME_S);
    compare_brute(brute, plant, bus_v, periods, command);
}

/// The same for any brute force.
fn compare_brute(
    mut brute: BruteForce,
    mut plant: Plant,
    bus_v: f64,
    periods: u32,
    command: impl Fn(u32, &Plant) -> [Bridge; 2],
) {
    let mut peak_a = 0.0_f64;
    let mut worst_a = 0.0_f64;
    let mut most_apart_a = 0.0_f64;
    let list = |f: Flow| [f.torque_nm, f.torque_square, f.motor_w, f.copper_w, f.bus_a];
    let (mut apart, mut gross) = ([0.0; 5], [0.0; 5]);
    let (mut sums, mut brute_sums) = ([0.0; 2], [0.0; 2]);
    for k in 0..periods {
        let halves = command(k, &plant);
        let flow = plant.period(halves, bus_v, PERIOD_S, DEAD_TIME_S);
        let brute_flow = brute.period(halves, bus_v, PERIOD_S);
        most_apart_a = most_apart_a.max((flow.most_a - brute_flow.most_a).abs());
        let (flow, brute_flow) = (list(flow), list(brute_flow));
        for n in 0..2 {
            sums[n] += flow[n];
            brute_sums[n] += brute_flow[n];
        }
        for n in 0..5 {
            apart[n] += flow[n] - brute_flow[n];
            gross[n] += brute_flow[n].abs();
        }
        for (a, b) in plant.currents_a().into_iter().zip(brute.currents_a()) {
            peak_a = peak_a.max(b.abs());
            worst_a = worst_a.max((a - b).abs());
        }
    }
    assert!(peak_a > 0.1, "nothing flows");
    assert!(worst_a < 1e-6 * peak_a, "{worst_a} A of {peak_a} A");
    // A sweep has the currents at the voltage steps without what a dead time's diode adds.
    assert!(
        most_apart_a < 0.01 * peak_a,
        "{most_apart_a} A of {peak_a} A"
    );
    for (apart, gross) in apart.into_iter().zip(gross) {
        assert!(apart.abs() <= 1e-4 * gross + 1e-9, "{apart} of {gross}");
    }
    let share = 1.0 / f64::from(periods);
    let ripple_pct =
        |torque: f64, square: f64| 100.0 * (square * share / (torque * share).powi(2) - 1.0).sqrt();
    let [ours, theirs] = [sums, brute_sums].map(|sums| ripple_pct(sums[0], sums[1]));
    assert!((ours - theirs).abs() < 0.1, "{ours} % for {theirs} %");
}

#[test]
fn loaded_field_oriented_drive_is_as_by_brute_force() {
    let plant = held(Fidelity::Switching, 4500.0, 0.1);
    compare(plant, 24.0, 30, |_, plant| {
        [field_oriented(plant, 5.0, 24.0); 2]
    });
}

/// Half an ampere: the ripple crosses zero in many dead times, where currents stay at zero.
#[test]
fn zero_crossings_in_the_dead_time_are_as_by_brute_force() {
    let plant = held(Fidelity::Switching, 3000.0, 0.37);
    compare(plant, 24.0, 30, |_, plant| {
        [field_oriented(plant, 0.5, 24.0); 2]
    });
}

#[test]
fn a_command_that_changes_within_the_period_is_as_by_brute_force() {
    let plant = held(Fidelity::Switching, 2000.0, 0.8);
    let commands = [
        duties([0.9, 0.0, 0.3]),
        duties([0.012, 0.5, 1.0]),
        duties([0.98, 0.4, 0.02]),
        Bridge::Brake,
        Bridge::Off,
        legs([Some(0.4), Some(0.2), None]),
        Bridge::Charge(Duty::from_num(0.3)),
    ];
    compare(plant, 24.0, 28, |k, _| {
        let at = |k: u32| commands[k as usize % commands.len()];
        [at(k), at(k * 3 + 1)]
    });
}

/// Two legs switch and the third floats, as in six-step commutation every sixth of a turn.
#[test]
fn six_step_commutation_is_as_by_brute_force() {
    let plant = held(Fidelity::Switching, 4000.0, 0.02);
    compare(plant, 24.0, 40, |_, plant| [six_step(plant); 2]);
}

/// Two legs drive, the third floats.
fn six_step(plant: &Plant) -> Bridge {
    let (duty, low) = (Some(0.75), Some(0.0));
    let sector = (plant.angle_turns() * 6.0) as usize;
    let pattern = [
        [None, duty, low],
        [low, duty, None],
        [low, None, duty],
        [None, low, duty],
        [duty, low, None],
        [duty, None, low],
    ];
    legs(pattern[sector])
}

#[test]
fn a_rectifying_bridge_is_as_by_brute_force() {
    let plant = held(Fidelity::Switching, 6000.0, 0.55);
    compare(plant, 12.0, 60, |_, _| [Bridge::Off; 2]);
}

#[test]
fn the_bridge_rectifies_above_the_supply_and_two_diodes_and_not_below() {
    // Line to line √3·2π·100·12·1.3 mWb = 16.98 V at 6000 rpm.
    for (bus_v, conducts) in [(15.5, true), (15.65, false)] {
        for fidelity in [Fidelity::Averaged, Fidelity::Switching] {
            let mut plant = held(fidelity, 6000.0, 0.2);
            let flows: Vec<Flow> = (0..50)
                .map(|_| plant.period([Bridge::Off; 2], bus_v, PERIOD_S, DEAD_TIME_S))
                .collect();
            assert!(flows.iter().all(|flow| flow.bus_a <= 0.0));
            let charged = flows.iter().any(|flow| flow.bus_a < -1e-3);
            assert_eq!(charged, conducts, "{fidelity:?} {bus_v}");
            assert_eq!(flows.iter().any(|f| f.torque_nm < 0.0), conducts);
        }
    }
}

#[test]
fn currents_die_against_the_supply_when_all_is_off() {
    let mut plant = held(Fidelity::Averaged, 0.0, 0.0);
    // The rotor is at phase a: a current there makes no torque.
    for _ in 0..400 {
        plant.period([duties([0.55, 0.5, 0.5]); 2], 24.0, PERIOD_S, 0.0);
    }
    let amps = plant.currents_a()[0];
    assert!((amps - 0.05 * 24.0 * 2.0 / 3.0 / 0.108).abs() < 1e-3);
    let flow = plant.period([Bridge::Off; 2], 24.0, PERIOD_S, 0.0);
    assert_eq!(plant.currents_a(), [0.0; 3]);
    // The inductance's energy, 3/4·L·i² less the copper's and the diodes' loss, goes into the
    // supply.
    let stored_j = 0.75 * MOTOR.inductance_h * amps * amps;
    let back_j = -flow.bus_a * 24.0 * PERIOD_S;
    assert!(
        (0.85..1.0).contains(&(back_j / stored_j)),
        "{back_j} {stored_j}"
    );
}

/// Catching a turning rotor relies on this: with the low sides on, each current grows with the
/// back-EMF, e/L; between two phases of opposite e that is e_ll/(2L).
#[test]
fn short_circuit_pulses_show_the_induced_voltage() {
    let half_s = 0.5 * PERIOD_S;
    // 1 µs before the sample and 1 µs after it.
    let charge = Bridge::Charge(Duty::from_num(1e-6 / half_s));
    let rpm = 6000.0;
    let omega = rpm * TAU / 60.0 * f64::from(MOTOR.pole_pairs);
    for fidelity in [Fidelity::Averaged, Fidelity::Switching] {
        // In the middle of the pulse phase c's axis is along the flux, so that it induces nothing
        // there.
        let turns_to_pulse = omega * (PERIOD_S - 0.5e-6) / TAU;
        let mut plant = held(fidelity, rpm, 2.0 / 3.0 - turns_to_pulse);
        plant.period([Bridge::Off, charge], 24.0, PERIOD_S, DEAD_TIME_S);
        let [a, b, c] = plant.currents_a();
        let line_v = 3.0_f64.sqrt() * omega * MOTOR.flux_wb;
        let wanted = line_v * 1e-6 / (2.0 * MOTOR.inductance_h);
        assert!((a.abs() - wanted).abs() < 0.005 * wanted, "{a} {wanted}");
        assert!((a + b).abs() < 0.01 * wanted && c.abs() < 0.01 * wanted);
        // The low sides carry it: the shunts show it for as long as they do.
        for on_s in plant.low_s() {
            assert!((on_s.unwrap_or(0.0) - 1e-6).abs() < 1e-12);
        }
        let flow = plant.period([charge, Bridge::Off], 24.0, PERIOD_S, DEAD_TIME_S);
        assert!(flow.bus_a < 0.0 && plant.currents_a() == [0.0; 3]);
    }
}

#[test]
fn three_currents_that_end_together_leave_no_diode_on() {
    for duty_a in [0.3, 0.6] {
        let mut plant = held(Fidelity::Averaged, 0.0, 0.0);
        for _ in 0..3 {
            let along_a = duties([duty_a, 0.45, 0.45]);
            plant.period([along_a; 2], 24.0, PERIOD_S, DEAD_TIME_S);
        }
        assert!(plant.currents_a()[0].abs() > 1.0);
        for _ in 0..3 {
            plant.period([Bridge::Off; 2], 24.0, PERIOD_S, DEAD_TIME_S);
        }
        assert_eq!(plant.currents_a(), [0.0; 3]);
        assert_eq!(plant.terminals_v(), [0.0; 3]);
    }
}

#[test]
fn floating_terminals_show_what_the_rotor_induces() {
    let emf = |plant: &Plant| {
        let peak = plant.speed_rad_s() * f64::from(MOTOR.pole_pairs) * MOTOR.flux_wb;
        [0.0, 1.0, 2.0].map(|phase| {
            let angle = TAU * (plant.angle_turns() - phase / 3.0);
            -peak * angle.sin()
        })
    };
    for k in 0..50 {
        let angle_turns = f64::from(k) / 50.0;
        let after = |rpm: f64, bridge: Bridge| {
            let mut plant = held(Fidelity::Averaged, rpm, angle_turns);
            for _ in 0..3 {
                plant.period([bridge; 2], 24.0, PERIOD_S, DEAD_TIME_S);
            }
            plant
        };
        let close = |plant: &Plant, wanted: [f64; 3]| {
            for (shown, wanted) in plant.terminals_v().into_iter().zip(wanted) {
                assert!((shown - wanted).abs() < 1e-6, "{shown} for {wanted}");
            }
        };

        // Slow: the dividers' star is at ground.
        let plant = after(300.0, Bridge::Off);
        close(&plant, emf(&plant));
        // Faster: the lowest terminal hangs on its diode.
        let plant = after(3000.0, Bridge::Off);
        let e = emf(&plant);
        let lowest = e[0].min(e[1]).min(e[2]);
        close(&plant, e.map(|e| e - lowest - DIODE_V));
        // One low side holds its terminal, and the others show the difference: too slow for a diode
        // to conduct.
        let plant = after(200.0, legs([Some(0.0), None, None]));
        let e = emf(&plant);
        close(&plant, [0.0, e[1] - e[0], e[2] - e[0]]);
        // Two legs hold the star between them, except for the third's half.
        let plant = after(200.0, legs([Some(0.3), None, Some(0.3)]));
        let e = emf(&plant);
        close(&plant, [0.0, 1.5 * e[1], 0.0]);
        // All low sides on.
        let plant = after(3000.0, duties([0.2, 0.6, 0.4]));
        close(&plant, [0.0; 3]);
        // A high side on for the whole period.
        let mut plant = held(Fidelity::Switching, 3000.0, angle_turns);
        plant.period([duties([1.0, 0.2, 0.3]); 2], 24.0, PERIOD_S, DEAD_TIME_S);
        close(&plant, [24.0, 0.0, 0.0]);
        assert_eq!(plant.low_s()[0], None);
    }
}

#[test]
fn a_free_shaft_slows_down_as_the_load_says() {
    let load = Load {
        c1: 1e-4,
        inertia_kgm2: 1e-4,
        ..Load::default()
    };
    let mut plant = Plant::new(Fidelity::Averaged, *MOTOR, load, 100.0, 0.1);
    for _ in 0..10_000 {
        plant.period([Bridge::Off; 2], 24.0, 1e-4, 0.0);
    }
    // e^(−c1/J·t) after 1 s.
    assert!((plant.speed_rad_s() - 100.0 * (-1.0_f64).exp()).abs() < 1e-6);
}

/// The default bench, spun up by its own control.
fn rig(plant: Fidelity) -> Rig {
    rig_with(plant, Extras::default())
}

/// The same with a non-ideal motor.
fn rig_with(plant: Fidelity, extras: Extras) -> Rig {
    let bench = Bench {
        plant,
        extras,
        ..Bench::default()
    };
    let config = build(&Params::of(&BOSSO_BENCH), &bench.sensing.board(bench.delay)).unwrap();
    Rig::new(bench, config)
}

/// From standstill through the start to 4500 rpm, held there, and braked from there: returns the
/// greatest difference between what came in and what went out or is stored, relative to what came
/// in.
fn imbalance(mut rig: Rig) -> f64 {
    let load = Bench::default().load;
    let speed = |rig: &Rig, rpm| Setpoint::Speed(rig.config().scale.speed_from_rpm(rpm));
    let period_s = rig.period_s();
    let stored = |rig: &Rig| rig.plant().stored_j();
    let start = stored(&rig);
    let (mut input, mut output, mut apart) = (0.0, 0.0, 0.0_f64);
    for k in 0..60_000 {
        let rpm = if k < 40_000 { 4500.0 } else { 3000.0 };
        let setpoint = speed(&rig, rpm);
        let before = rig.plant().speed_rad_s();
        let flow = rig.period(setpoint).motion.flow;
        let after = rig.plant().speed_rad_s();
        // The load by the trapezoidal rule between samples.
        let load_w = |w: f64| load.damping_at(w) * w * w;
        let lost_w = flow.copper_w + flow.drag_w + 0.5 * (load_w(before) + load_w(after));
        input += period_s * flow.motor_w;
        output += period_s * lost_w;
        let grown = stored(&rig) - start;
        apart = apart.max((input - output - grown).abs());
    }
    assert!(input > 50.0, "{input} J");
    apart / input
}

#[test]
fn energy_is_conserved_over_a_switching_run() {
    let apart = imbalance(rig(Fidelity::Switching));
    assert!(apart < 1e-6, "{apart}");
}

#[test]
fn both_fidelities_make_the_same_torque() {
    let mean_torque = |fidelity| {
        let mut rig = rig(fidelity);
        let spin = Setpoint::Speed(rig.config().scale.speed_from_rpm(3000.0));
        for _ in 0..30_000 {
            rig.period(spin);
        }
        let hold = Setpoint::Torque(rig.config().scale.current_from_a(5.0));
        let torques = (0..4_800).map(|_| rig.period(hold).motion.flow.torque_nm);
        torques.sum::<f64>() / 4_800.0
    };
    let [averaged, switching] = [Fidelity::Averaged, Fidelity::Switching].map(mean_torque);
    assert!(
        (averaged / switching - 1.0).abs() < 0.005,
        "{averaged} {switching}"
    );

    // Without regulation, and so without dead time: its loss is not the mean of the loss over the
    // ripple, and the current follows every 0.01 V.
    let open_loop = |fidelity| {
        let mut plant = held(fidelity, 4500.0, 0.1);
        let flows = (0..600).map(|_| {
            let bridge = field_oriented(&plant, 5.0, 24.0);
            plant.period([bridge; 2], 24.0, PERIOD_S, 0.0)
        });
        let torques: Vec<f64> = flows.map(|flow| flow.torque_nm).collect();
        torques[400..].iter().sum::<f64>() / 200.0
    };
    let [averaged, switching] = [Fidelity::Averaged, Fidelity::Switching].map(open_loop);
    assert!(
        (averaged / switching - 1.0).abs() < 0.005,
        "{averaged} {switching}"
    );
}

#[test]
fn a_stuck_hall_sensor_shows_its_level() {
    let mut rig = rig(Fidelity::Averaged);
    let whole = rig.period(Setpoint::Stop).sample.hall;
    let sound = InForce::default();
    let stuck = InForce {
        hall: [Some(false), Some(true), None],
        ..sound
    };
    rig.disturb(&sound, &stuck);
    let broken = rig.period(Setpoint::Stop).sample.hall;
    assert_eq!(broken, whole & 0b100 | 0b010);
    rig.disturb(&stuck, &sound);
    assert_eq!(rig.period(Setpoint::Stop).sample.hall, whole);
}

fn any_bridge() -> impl Strategy<Value = Bridge> {
    let duty = || prop_oneof![Just(0.0), Just(1.0), 0.0..1.0_f64];
    let leg = prop_oneof![Just(None), duty().prop_map(Some)];
    prop_oneof![
        Just(Bridge::Off),
        Just(Bridge::Brake),
        duty().prop_map(|share| Bridge::Charge(Duty::from_num(share))),
        [duty(), duty(), duty()].prop_map(duties),
        [leg.clone(), leg.clone(), leg].prop_map(legs),
    ]
}

proptest! {
    /// Under any commands energy is conserved, and no current flows from an unconnected phase.
    #[test]
    fn energy_is_conserved_through_any_commands(
        commands in prop::collection::vec(any_bridge(), 1..40),
        rpm in -9000.0..9000.0_f64,
        bus_v in 5.0..40.0_f64,
        dead_time_s in 0.0..3e-6_f64,
        averaged in any::<bool>(),
    ) {
        let fidelity = if averaged { Fidelity::Averaged } else { Fidelity::Switching };
        let mut plant = held(fidelity, rpm, 0.3);
        let stored = |plant: &Plant| {
            let [a, b, c] = plant.currents_a();
            0.5 * MOTOR.inductance_h * (a * a + b * b + c * c)
        };
        let (mut balance, mut gross) = (0.0, 1e-9);
        for pair in commands.windows(2) {
            let before = stored(&plant);
            let flow = plant.period([pair[0], pair[1]], bus_v, 50e-6, dead_time_s);
            let shaft_w = flow.torque_nm * plant.speed_rad_s();
            let grown = stored(&plant) - before;
            balance += 50e-6 * (flow.motor_w - flow.copper_w - shaft_w) - grown;
            gross += 50e-6 * (flow.motor_w.abs() + flow.copper_w + shaft_w.abs());
            // Diodes only dissipate.
            prop_assert!(bus_v * flow.bus_a >= flow.motor_w - 1e-6);
            let [a, b, c] = plant.currents_a();
            prop_assert!((a + b + c).abs() < 1e-9 && a.abs() < 1e4);
        }
        // The integral of a square is off by 0.06·(R/L·h)² if a current grows from zero: here by
        // 5e-4 over a whole half period.
        prop_assert!(balance.abs() < 5e-4 * gross, "{balance} of {gross}");
    }
}
