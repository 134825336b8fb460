//! A fault in each phase of each drive turns the bridge off in the period that sees it.

use super::*;

/// Both drives, at a speed that gives six-step enough periods per sextant.
const DRIVES: [[(ParamId, f32); 2]; 2] = [
    [(ParamId::CtlDrive, 0.0), (ParamId::CtlRpmMax, 4500.0)],
    [(ParamId::CtlDrive, 1.0), (ParamId::CtlRpmMax, 4500.0)],
];

/// Beyond the trip of 28 A.
const OVER_CURRENT: [f64; 3] = [-15.0, -15.0, 30.0];

/// Returns the set-point that keeps a drive in a phase.
fn asked(bench: &Bench, phase: Phase) -> Setpoint {
    match phase {
        Phase::Brake => Setpoint::Stop,
        Phase::Tone => Setpoint::Tone(Speed::from_num(1000.0 * bench.config.scale.period_s)),
        _ => bench.turn(),
    }
}

/// Returns a bench that has reached a phase.
fn within(drive: &[(ParamId, f32)], phase: Phase) -> Bench {
    let mut bench = Bench::new(drive);
    let turn = bench.turn();
    bench.until(bench.beginning(), turn);
    bench.state.phase = phase;
    if let Some(six_step) = &bench.config.six_step {
        // One that stands still in Run has failed to start.
        bench.state.six_step.tracking.omega_bar = six_step.run_speed;
    }
    let asked = asked(&bench, phase);
    bench.state.set_foc_kind(&bench.config, &asked);
    bench
}

/// Repeats this until a fault is seen, when the bridge must already be off; returns the periods.
fn periods_to_fault(bench: &mut Bench, sample: Sample, setpoint: Setpoint, fault: Fault) -> u32 {
    for periods in 1..=3 {
        let bridge = bench.run(1, sample, setpoint);
        if !bench.faults().is_empty() {
            assert!(bench.faults().contains(fault));
            assert_eq!(bridge, Bridge::Off);
            assert_eq!(bench.phase(), Phase::Idle);
            assert_eq!(bench.quiet(1, setpoint), Bridge::Off);
            return periods;
        }
    }
    panic!("no {fault:?} in {:?}", bench.phase());
}

#[test]
fn a_fault_from_outside_turns_the_bridge_off_at_once_in_each_phase() {
    for drive in DRIVES {
        for phase in Phase::ALL {
            let mut bench = within(&drive, phase);
            let (fault, still) = (Fault::OverTemperature, sample([0.0; 3], 24.0));
            let periods = periods_to_fault(&mut bench, still, Setpoint::Fault(fault), fault);
            assert_eq!(periods, 1, "{phase:?}");
        }
    }
}

#[test]
fn the_second_sample_above_the_trip_turns_the_bridge_off_in_each_phase_that_switches() {
    for drive in DRIVES {
        for phase in Phase::ALL.into_iter().filter(|phase| !phase.is_off()) {
            let mut bench = within(&drive, phase);
            let asked = asked(&bench, phase);
            let above = sample(OVER_CURRENT, 24.0);
            let periods = periods_to_fault(&mut bench, above, asked, Fault::OverCurrent);
            assert_eq!(periods, 2, "{phase:?}");
        }
    }
}

#[test]
fn a_supply_beyond_its_limit_turns_the_bridge_off_in_each_phase() {
    for drive in DRIVES {
        for phase in Phase::ALL {
            let mut bench = within(&drive, phase);
            let asked = asked(&bench, phase);
            // An eighth of the excess over 24 V per period: 28.5 V, and 32.4 V where the maximum is
            // 30 V.
            let high = sample([0.0; 3], 60.0);
            let periods = periods_to_fault(&mut bench, high, asked, Fault::OverVoltage);
            assert_eq!(periods, 2, "{phase:?}");
        }
    }
}
