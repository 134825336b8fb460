//! A broken stage against brute force, and what its sensors and comparators see.

use super::*;

const LOW: usize = 0;
const HIGH: usize = 1;

/// Returns breaks of phase b's leg.
fn broken(leg: LegBreaks) -> Breaks {
    Breaks([LegBreaks::default(), leg, LegBreaks::default()])
}

fn wire() -> Breaks {
    broken(LegBreaks {
        wire: true,
        ..LegBreaks::default()
    })
}

fn open(switch: usize) -> Breaks {
    let mut leg = LegBreaks::default();
    leg.open[switch] = true;
    broken(leg)
}

fn shorted(switch: usize) -> Breaks {
    let mut leg = LegBreaks::default();
    leg.shorted[switch] = true;
    broken(leg)
}

/// Drives with broken parts, without comparators.
fn compare_broken(
    fidelity: Fidelity,
    rpm: f64,
    breaks: Breaks,
    command: impl Fn(u32, &Plant) -> [Bridge; 2],
) {
    let mut plant = held(fidelity, rpm, 0.1);
    plant.break_legs(&breaks);
    let mut brute = BruteForce::new(*MOTOR, &[], &plant, DEAD_TIME_S);
    brute.breaks = breaks;
    compare_brute(brute, plant, 24.0, 30, command);
}

#[test]
fn drive_with_an_open_wire_is_as_by_brute_force() {
    for fidelity in [Fidelity::Averaged, Fidelity::Switching] {
        compare_broken(fidelity, 4500.0, wire(), |_, plant| {
            [field_oriented(plant, 5.0, 24.0); 2]
        });
    }
}

#[test]
fn drive_with_an_open_switch_is_as_by_brute_force() {
    for switch in [LOW, HIGH] {
        compare_broken(Fidelity::Switching, 3000.0, open(switch), |_, plant| {
            [field_oriented(plant, 8.0, 24.0); 2]
        });
    }
}

/// With all gates off the shorted switch and the other legs' diodes brake the rotor.
#[test]
fn a_turning_rotor_on_a_shorted_switch_is_as_by_brute_force() {
    for switch in [LOW, HIGH] {
        compare_broken(Fidelity::Switching, 4500.0, shorted(switch), |_, _| {
            [Bridge::Off; 2]
        });
    }
}

#[test]
fn six_step_commutation_with_an_open_wire_is_as_by_brute_force() {
    compare_broken(Fidelity::Switching, 4000.0, wire(), |k, _| {
        let (duty, low) = (Some(0.75), Some(0.0));
        let patterns = [[duty, low, None], [duty, None, low], [None, duty, low]];
        [legs(patterns[k as usize / 4 % 3]); 2]
    });
}

/// The motor's part of a shoot-through: half the supply's voltage, and half the current from it.
#[test]
fn a_divider_of_two_switches_is_as_by_brute_force() {
    let mut plant = held(Fidelity::Switching, 1000.0, 0.1);
    plant.break_legs(&shorted(LOW));
    let mut brute = BruteForce::new(*MOTOR, &[], &plant, DEAD_TIME_S);
    brute.breaks = shorted(LOW);
    for _ in 0..10 {
        let command = [duties([0.4, 0.3, 0.35]); 2];
        let ours = plant.period(command, 24.0, PERIOD_S, DEAD_TIME_S);
        let theirs = brute.period(command, 24.0, PERIOD_S);
        for (a, b) in plant.currents_a().into_iter().zip(brute.currents_a()) {
            assert!((a - b).abs() < 1e-3, "{a} A for {b} A");
        }
        // 24 V over two switches of 3 mΩ for 0.3 of the period, less a dead time, bypasses the motor.
        let past_a = 4000.0 * (0.3 - DEAD_TIME_S / PERIOD_S);
        let bus_a = ours.bus_a - past_a;
        assert!(
            (bus_a - theirs.bus_a).abs() < 0.01,
            "{bus_a} A for {}",
            theirs.bus_a
        );
    }
}

#[test]
fn a_current_ends_where_its_wire_opens_and_comes_back_with_it() {
    let mut plant = held(Fidelity::Averaged, 1000.0, 0.1);
    let command = [duties([0.6, 0.4, 0.5]); 2];
    for _ in 0..5 {
        plant.period(command, 24.0, PERIOD_S, DEAD_TIME_S);
    }
    let before = plant.currents_a();
    plant.break_legs(&wire());
    let [a, b, c] = plant.currents_a();
    let kept_a = 0.5 * (before[0] - before[2]);
    assert!(before[1].abs() > 1.0 && b.abs() < 1e-9, "{before:?} {b}");
    assert!(
        (a - kept_a).abs() < 1e-9 && (c + kept_a).abs() < 1e-9,
        "{a} {c}"
    );

    plant.break_legs(&Breaks::default());
    for _ in 0..5 {
        plant.period(command, 24.0, PERIOD_S, DEAD_TIME_S);
    }
    assert!(plant.currents_a()[1].abs() > 1.0);
}

/// The comparator ends a shoot-through after a microsecond, and holds the switches off until the
/// drive has turned them off too.
#[test]
fn a_shoot_through_trips_the_comparator() {
    for (switch, seen_at_sample) in [(LOW, false), (HIGH, true)] {
        let mut plant = held(Fidelity::Averaged, 0.0, 0.1);
        plant.set_comparator_a(32.0);
        plant.break_legs(&shorted(switch));
        let command = [duties([0.5; 3]); 2];
        let flow = plant.period(command, 24.0, PERIOD_S, DEAD_TIME_S);
        assert!(plant.tripped());
        let bus_a = 4000.0 * 1e-6 / PERIOD_S;
        assert!((flow.bus_a / bus_a - 1.0).abs() < 0.05, "{}", flow.bus_a);
        let flow = plant.period(command, 24.0, PERIOD_S, DEAD_TIME_S);
        assert!(plant.tripped() && flow.bus_a.abs() < 1.0, "{}", flow.bus_a);
        plant.period([Bridge::Off; 2], 24.0, PERIOD_S, DEAD_TIME_S);
        assert!(!plant.tripped());

        // Without a comparator a shunt shows it if the low sides are on at the sample.
        plant.set_comparator_a(f64::INFINITY);
        plant.break_legs(&shorted(switch));
        plant.period(command, 24.0, PERIOD_S, DEAD_TIME_S);
        let shunts_a = plant.shunts_a(plant.currents_a());
        assert_eq!(shunts_a[1] < -1000.0, seen_at_sample, "{shunts_a:?}");
    }
}
