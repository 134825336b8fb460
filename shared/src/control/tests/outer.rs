//! The outer loops around a current loop and a motor with its propeller.

use std::vec::Vec;

use siskin_params::ParamId;
use siskin_units::{AdcCounts, Current};

use super::motor::{Loop, Motor};
use super::{P, PHI, R, TS, Units, config_with};
use crate::control::PERIODS;
use crate::control::observer::SlowEstimate;
use crate::control::regulator::Reference;
use crate::control::speed::{self, Bounds};
use crate::control::{torque, voltage};
use crate::protection;

use fixed::types::I1F31;

struct Bench {
    inner: Loop,
    speed: speed::State,
    torque: torque::State,
    bounds: Bounds,
    wanted: Reference,
    periods: u32,
}

impl Bench {
    fn new(changes: &[(ParamId, f32)], motor: Motor) -> Self {
        let units = Units(config_with(changes));
        let bounds = Bounds {
            min: units.current(-20.0),
            max: units.current(20.0),
        };
        let mut speed = speed::State::default();
        let begin = units.speed(motor.omega());
        units.0.speed.preset(&mut speed, begin, Current::ZERO);
        Self {
            inner: Loop::new(units, motor),
            speed,
            torque: torque::State::default(),
            bounds,
            wanted: Reference::default(),
            periods: 0,
        }
    }

    /// Returns true if the outer loops run in this period.
    fn outer(&mut self) -> bool {
        self.periods += 1;
        self.periods % PERIODS == 1
    }

    /// Runs one period of speed control; returns the speed after it, rpm.
    fn turn(&mut self, rpm: f64) -> f64 {
        if self.outer() {
            let units = &self.inner.units;
            let input = speed::Input {
                command: units.0.scale.speed_from_rpm(rpm as f32),
                speed: units.speed(self.inner.motor.omega()),
                slow_estimate: SlowEstimate {
                    xi: units.xi(1.0 / PHI),
                    ..SlowEstimate::default()
                },
                bounds: self.bounds,
                i_q_shortfall: self.inner.i_q_shortfall,
            };
            self.wanted = units.0.speed.current(&mut self.speed, &input);
        }
        self.inner.period(&self.wanted);
        self.inner.motor.rpm()
    }

    fn turn_for(&mut self, seconds: f64, rpm: f64) -> Vec<f64> {
        let periods = (seconds / TS) as usize;
        (0..periods).map(|_| self.turn(rpm)).collect()
    }

    fn reference_rpm(&self) -> f64 {
        self.inner.units.rad_s(self.speed.reference()) / P * 60.0 / std::f64::consts::TAU
    }
}

/// Figure 8 of the first paper, with the inertia and the load as stated and wrong by 30 %.
#[test]
fn steps_settle_in_time_and_do_not_overshoot() {
    for (inertia, load) in [
        (1.0, 1.0),
        (0.7, 1.0),
        (1.3, 1.0),
        (1.0, 0.7),
        (0.7, 1.3),
        (1.3, 0.7),
    ] {
        let mut motor = Motor::bench(3000.0);
        motor.inertia_kgm2 *= inertia;
        motor.c1 *= load;
        motor.c2 *= load;
        let mut bench = Bench::new(&[(ParamId::CtlRegulator, 1.0)], motor);
        bench.turn_for(1.0, 3000.0);
        for (to, sign) in [(6000.0, 1.0), (3000.0, -1.0)] {
            let run = bench.turn_for(1.0, to);
            let over = run.iter().map(|rpm| sign * (rpm - to)).fold(0.0, f64::max);
            assert!(
                over < 5.0,
                "{inertia} J, {load} load, to {to}: {over} rpm over"
            );
            // 1 % of the step.
            let settled = run.iter().rposition(|rpm| (rpm - to).abs() > 30.0);
            let settled_s = settled.expect("it has moved") as f64 * TS;
            assert!(
                settled_s < 0.35,
                "{inertia} J, {load} load, to {to}: {settled_s} s"
            );
        }
    }
}

/// Figure 8(e) of the first paper, within the slew.
#[test]
fn an_amplitude_modulated_sine_is_tracked() {
    let mut bench = Bench::new(&[(ParamId::CtlRegulator, 1.0)], Motor::bench(4500.0));
    bench.turn_for(1.0, 4500.0);
    let mut square = 0.0;
    let periods = (3.0 / TS) as u32;
    for period in 0..periods {
        let t = f64::from(period) * TS;
        let swell = (std::f64::consts::PI * t / 3.0).sin().powi(2);
        let command = 4500.0 + 1000.0 * swell * (std::f64::consts::TAU * 3.0 * t).sin();
        let error = bench.turn(command) - command;
        square += error * error / f64::from(periods);
    }
    // The published loop without feed-forward has an error of 163 rpm rms.
    assert!(square.sqrt() < 20.0, "{} rpm rms", square.sqrt());
}

#[test]
fn the_reference_waits_for_a_drive_that_cannot_follow() {
    for changes in [
        // Half of the current that the slew needs, and a voltage that gives out below the command.
        (6.0, 13.4),
        (20.0, 9.0),
    ] {
        let (current_a, voltage_v) = changes;
        let mut bench = Bench::new(&[(ParamId::CtlRegulator, 1.0)], Motor::bench(3000.0));
        bench.turn_for(1.0, 3000.0);
        bench.inner.vector_max = bench.inner.units.voltage(voltage_v);
        bench.bounds = Bounds {
            min: bench.inner.units.current(-current_a),
            max: bench.inner.units.current(current_a),
        };
        for _ in 0..(1.5 / TS) as usize {
            let rpm = bench.turn(6000.0);
            let ahead = (bench.reference_rpm() - rpm).abs();
            assert!(ahead < 60.0, "{changes:?}: {ahead} rpm ahead at {rpm}");
        }
        let top = bench.inner.motor.rpm();
        assert!(top > 4000.0 && top < 5900.0, "{changes:?}: {top}");
        // It reverses at once, and lands as softly.
        let back = bench.turn_for(1.5, 3000.0);
        assert!(
            back[150] < top - 20.0,
            "{changes:?}: {top} to {}",
            back[150]
        );
        let least = back.iter().copied().fold(f64::MAX, f64::min);
        assert!(least > 2995.0, "{changes:?}: {least}");
    }
}

/// Figure 47 with the modified regulator of the figure.
#[test]
fn the_second_papers_loop_arrives_without_a_steady_error() {
    let changes = [(ParamId::CtlSpeed, 1.0), (ParamId::CtlRegulator, 2.0)];
    let mut bench = Bench::new(&changes, Motor::bench(3000.0));
    for rpm in [3000.0, 5000.0, 2000.0] {
        let run = bench.turn_for(2.0, rpm);
        let last = run.last().expect("it has run");
        assert!((last - rpm).abs() < 1.0, "{last} instead of {rpm}");
    }
}

/// A share of the voltage reaches the motor unchanged while the current is within bounds.
#[test]
fn a_commanded_voltage_is_given_until_a_bound_takes_over() {
    for regulator in [0.0, 1.0, 2.0] {
        let mut bench = Bench::new(&[(ParamId::CtlRegulator, regulator)], Motor::bench(3000.0));
        let mut run = |share: f64, seconds: f64| {
            let mut most = 0.0_f64;
            let mut last = (0.0, 0.0);
            for _ in 0..(seconds / TS) as usize {
                let outer = bench.outer();
                let inner = &mut bench.inner;
                if outer {
                    let asked = voltage::reference(
                        &inner.units.0.regulator,
                        &inner.regulator,
                        &inner.feedback(),
                        Current::ZERO,
                        voltage::of_share(I1F31::from_num(share), inner.vector_max),
                    );
                    let config = &inner.units.0.torque;
                    bench.wanted = torque::follow(config, &mut bench.torque, asked, bench.bounds);
                }
                last = inner.period(&bench.wanted);
                most = most.max(inner.motor.i_dq().1.abs());
            }
            (last, most, bench.inner.motor.clone())
        };
        let (_, _, motor) = run(0.5, 2.0);
        let (u, _, _) = run(0.5, 0.01);
        // 6.7 V; the modified one's is the length.
        let given = if regulator == 2.0 {
            u.0.hypot(u.1)
        } else {
            u.1
        };
        assert!((given - 6.7).abs() < 0.01, "{regulator}: {u:?}");
        assert!(
            motor.i_dq().0.abs() < 0.05,
            "{regulator}: {:?}",
            motor.i_dq()
        );
        // R·i + ω·φ, minus the 0.5 % that a voltage held for a period loses in the rotor's frame.
        let left = u.1 - motor.i_dq().1 * R - motor.omega() * PHI;
        assert!(left.abs() < 0.05, "{regulator}: {left} V");

        // Full throttle: unbounded, the current would be 43 A.
        let (_, most, motor) = run(0.85, 0.05);
        assert!(most < 27.0, "{regulator}: {most} A");
        let held = motor.i_dq().1;
        assert!((held - 20.0).abs() < 0.7, "{regulator}: {held} A");
        // And back: bounded braking.
        run(0.8, 1.0);
        let (_, most, motor) = run(0.3, 0.06);
        assert!(most < 28.0, "{regulator}: {most} A");
        assert!(
            (motor.i_dq().1 + 20.0).abs() < 1.0,
            "{regulator}: {:?}",
            motor.i_dq()
        );
    }
}

/// Torque mode: the current follows the command within the bounds, and a negative one brakes.
#[test]
fn a_commanded_current_brakes_within_the_bounds() {
    let mut bench = Bench::new(&[(ParamId::CtlRegulator, 1.0)], Motor::bench(5000.0));
    bench.bounds.min = bench.inner.units.current(-7.0);
    let asked = bench.inner.units.current(-12.0);
    let before = bench.inner.motor.rpm();
    let config = bench.inner.units.0.torque.clone();
    for _ in 0..(0.1 / TS) as usize {
        if bench.outer() {
            let asked = Reference::steady(asked);
            bench.wanted = torque::follow(&config, &mut bench.torque, asked, bench.bounds);
        }
        bench.inner.period(&bench.wanted);
    }
    assert!((bench.inner.motor.i_dq().1 + 7.0).abs() < 0.05);
    assert!(bench.inner.motor.rpm() < before - 1000.0);
}

/// Braking into a battery: the returned current stays within `LIM_REGEN_A` and decreases as the
/// voltage nears its limit. The second battery, nearly full and with a quarter ohm, would rise to
/// 30.5 V; at 5 A it has 29.25 V, where half of the 10 A is left.
#[test]
fn braking_is_bounded_by_the_supplys_current_and_voltage() {
    for (open_v, resistance_ohm, regen_a, volts_at_most, expected_a) in
        [(24.0, 0.05, 5.0, 25.0, 5.0), (28.0, 0.25, 10.0, 29.9, 5.0)]
    {
        let changes = [(ParamId::CtlRegulator, 1.0), (ParamId::LimRegenA, regen_a)];
        let mut bench = Bench::new(&changes, Motor::bench(6000.0));
        let limits = bench.inner.units.0.protection.clone();
        let config = bench.inner.units.0.torque.clone();
        let mut state = protection::State::new(&limits);
        for _ in 0..(0.05 / TS) as u32 {
            bench.inner.period(&Reference::default());
            protection::bound(&limits, &mut state, (Current::ZERO, Current::ZERO), 1);
        }
        let asked = Reference::steady(bench.inner.units.current(-20.0));
        let mut bus_v = open_v;
        let (mut most_v, mut most_a) = (0.0_f64, 0.0_f64);
        for period in 0..(0.1 / TS) as u32 {
            let bus = bench.inner.units.voltage(bus_v);
            let fault = protection::check(&limits, &mut state, Some([AdcCounts::ZERO; 3]), bus);
            assert_eq!(fault, None, "{resistance_ohm} ohm at {bus_v} V");
            let outer = bench.outer();
            if outer {
                bench.wanted = torque::follow(&config, &mut bench.torque, asked, state.bounds);
            }
            let i = bench.inner.motor.i_dq();
            let u = bench.inner.period(&bench.wanted);
            let returned_a = -1.5 * (u.0 * i.0 + u.1 * i.1) / bus_v;
            if outer {
                let units = &bench.inner.units;
                let seen = (units.current(-returned_a), units.current(i.1));
                protection::bound(&limits, &mut state, seen, PERIODS);
            }
            bus_v = open_v + resistance_ohm * returned_a;
            most_v = most_v.max(bus_v);
            if period > 300 {
                most_a = most_a.max(returned_a);
            }
        }
        assert!(
            most_v < volts_at_most,
            "{resistance_ohm} ohm: {most_v} V, {most_a} A"
        );
        assert!(most_a < 1.02 * f64::from(regen_a), "{most_a} A");
        assert!(most_a > 0.95 * expected_a, "{most_a} A");
    }
}
