use siskin_units::Duty;

use super::*;
use crate::rig::Bench;

fn plant() -> Plant {
    let motor = Bench::default().motor;
    let mut plant = Plant::new(Fidelity::Switching, motor, Load::default(), 0.0, 0.1);
    plant.impose(100.0);
    plant
}

/// With one leg off each edge is played; with three switching legs, all follow from one solution.
fn commands() -> [Bridge; 2] {
    let [low, high] = [0.2, 0.8].map(Duty::from_num::<f64>);
    [
        Bridge::Legs([Some(low), None, Some(high)]),
        Bridge::Duty([low, high, low]),
    ]
}

/// Asking for no dead time gives none.
#[test]
fn there_is_a_dead_time_between_the_switches() {
    for bridge in commands() {
        for dead_time_s in [500e-9, 0.0] {
            let mut plant = plant();
            for _ in 0..5 {
                plant.period([bridge; 2], 24.0, 41e-6, dead_time_s);
                assert_eq!(plant.crossed(), None, "{bridge:?} {dead_time_s}");
            }
        }
    }
}

/// A timer that drops a tenth of its dead time is found in that half period.
#[test]
fn a_dead_time_that_is_too_short_is_found() {
    const HALF_S: f64 = 20e-6;
    for bridge in commands() {
        for to in [Rail::High, Rail::Low] {
            for (dead_time_s, found) in [(500e-9, false), (450e-9, true), (0.0, true)] {
                let mut plant = plant();
                plant.period([bridge; 2], 24.0, 2.0 * HALF_S, 500e-9);
                plant.stage.begin(24.0, 2.0 * HALF_S, 500e-9);
                if to == Rail::Low {
                    plant.switch(bridge, Rail::High, HALF_S, 500e-9);
                }
                assert_eq!(plant.crossed(), None);
                let edges_s = plant.plain(bridge, to, HALF_S, dead_time_s);
                let swept = edges_s.is_some_and(|edges_s| {
                    let mut stage = plant.stage.clone();
                    stage.sweep(to, edges_s, dead_time_s, HALF_S)
                });
                assert_eq!(swept, matches!(bridge, Bridge::Duty(_)));
                plant.switch(bridge, to, HALF_S, dead_time_s);
                let crossed = plant.crossed().is_some();
                assert_eq!(crossed, found, "{bridge:?} {to:?} {dead_time_s}");
            }
        }
    }
}

/// A leg that has been off waits for no dead time: it must have been off for as long.
#[test]
fn a_leg_that_was_off_too_shortly_is_found() {
    let mut plant = plant();
    for (off_s, found) in [(400e-9, Some(1)), (500e-9, None)] {
        plant.stage.begin(24.0, 41e-6, 500e-9);
        plant.stage.set(1, Some(Rail::High));
        plant.stage.run(10e-6);
        plant.stage.set(1, None);
        plant.stage.run(off_s);
        plant.stage.set(1, Some(Rail::Low));
        assert_eq!(plant.crossed(), found, "{off_s}");
        plant.stage.set(1, None);
        plant.stage.run(10e-6);
    }
}
