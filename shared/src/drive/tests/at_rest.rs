//! Bridge off: what sensors and terminals show before the phases switch.

use super::*;
use crate::control::catch::Rotor;
use crate::drive::foc::begin::PREPARATION_PERIODS;

/// A rotor that turns at constant speed without current.
struct Coasting {
    bench: Bench,
    /// Mechanical, negative against the order a, b, c.
    rpm: f64,
    turns: f64,
}

impl Coasting {
    fn new(changes: &[(ParamId, f32)], rpm: f64) -> Self {
        Self {
            bench: Bench::new(changes),
            rpm,
            turns: 0.2,
        }
    }

    fn step(&mut self, setpoint: Setpoint) -> Bridge {
        self.turns += self.rpm * 12.0 / 60.0 / 24_000.0;
        let sample = Sample {
            terminals: terminals(self.turns, self.rpm),
            ..sample([0.0; 3], 24.0)
        };
        self.bench.run(1, sample, setpoint)
    }

    /// Runs until a phase begins; returns the number of periods.
    fn until(&mut self, phase: Phase, setpoint: Setpoint) -> u32 {
        for periods in 1..5000 {
            self.step(setpoint);
            if self.bench.phase() == phase {
                return periods;
            }
        }
        panic!("no {phase:?}, but {:?}", self.bench.phase());
    }

    fn angle_error_deg(&self) -> f64 {
        let truth = siskin_units::Angle::wrapping_from_num(self.turns);
        let angle = self.bench.state.snapshot().angle;
        angle.wrapping_sub(truth).to_num::<f64>() * 360.0
    }

    fn seen_rpm(&self) -> f64 {
        let speed = self.bench.state.snapshot().speed;
        f64::from(self.bench.config.scale.rpm(speed))
    }
}

fn speed(bench: &Bench, rpm: f32) -> Setpoint {
    Setpoint::Speed(bench.config.scale.speed_from_rpm(rpm))
}

#[test]
fn a_rotor_that_turns_is_caught_into_run() {
    for observer in [0.0, 1.0, 2.0, 3.0] {
        for (direction, sign) in [(0.0, 1.0), (1.0, -1.0)] {
            for rpm in [1000.0, 3000.0, 5500.0] {
                let changes = [
                    (ParamId::CtlObserver, observer),
                    (ParamId::MotDir, direction),
                ];
                let mut motor = Coasting::new(&changes, sign * rpm);
                let case = std::format!("{observer}, {direction}, {rpm}");
                let turn = motor.bench.turn();
                let periods = motor.until(Phase::Run, turn);
                // 128 offset readings, 63 µs of charge, and the preparation.
                assert!(periods < 145 + PREPARATION_PERIODS, "{case}: {periods}");
                let error = motor.angle_error_deg();
                assert!(error.abs() < 5.0, "{case}: {error}");
                let seen = motor.seen_rpm();
                assert!((seen / rpm - 1.0).abs() < 0.03, "{case}: {seen}");
                // Without current the voltage is the back-EMF.
                let u = motor.bench.state.snapshot().u;
                let volts = |u| f64::from(motor.bench.config.scale.volts(u));
                let emf = 1.3e-3 * rpm * 12.0 * TAU / 60.0;
                assert!((volts(u.q) / emf - 1.0).abs() < 0.1, "{case}: {u:?}");
                assert!(volts(u.d).abs() < 0.1 * emf, "{case}: {u:?}");
            }
        }
    }
}

#[test]
fn a_rotor_that_turns_backwards_is_stopped_first() {
    for (direction, sign) in [(0.0, -1.0), (1.0, 1.0)] {
        let mut motor = Coasting::new(&[(ParamId::MotDir, direction)], sign * 2000.0);
        let turn = motor.bench.turn();
        motor.until(Phase::Stopping, turn);
        assert!(motor.bench.state.shared.reversed);
        assert!(
            (motor.seen_rpm() + 2000.0).abs() < 60.0,
            "{}",
            motor.seen_rpm()
        );
        assert!(motor.angle_error_deg().abs() < 5.0);
    }
}

#[test]
fn with_both_directions_a_rotor_that_turns_backwards_may_go_on() {
    let mut motor = Coasting::new(&[(ParamId::Inp3d, 1.0)], -2000.0);
    let backwards = speed(&motor.bench, -2000.0);
    motor.until(Phase::Run, backwards);
    assert!(
        (motor.seen_rpm() + 2000.0).abs() < 60.0,
        "{}",
        motor.seen_rpm()
    );
    let forwards = speed(&motor.bench, 2000.0);
    motor.until(Phase::Stopping, forwards);
}

/// The ramp begins at the rotor's speed, with the quick attempt's current: four times `STA_RAMP_A`, 4 A.
#[test]
fn a_reversal_goes_through_standstill_without_waiting_for_it() {
    let mut motor = Coasting::new(&[(ParamId::Inp3d, 1.0)], 2000.0);
    let [forwards, backwards] = [2000.0, -2000.0].map(|rpm| speed(&motor.bench, rpm));
    motor.until(Phase::Run, forwards);
    motor.until(Phase::Stopping, backwards);
    while motor.bench.phase() == Phase::Stopping {
        motor.rpm = (motor.rpm - 1.0).max(0.0);
        motor.step(backwards);
    }
    assert_eq!(motor.bench.phase(), Phase::Park);
    assert!(motor.bench.state.shared.reversed);
    motor.until(Phase::Ramp, backwards);
    // Below `CTL_RPM_MIN`, and still forwards.
    assert!(
        (150.0..300.0).contains(&motor.seen_rpm()),
        "{}",
        motor.seen_rpm()
    );
    let snapshot = motor.bench.state.snapshot();
    let reference_a = motor.bench.config.scale.amperes(snapshot.i_q_reference);
    assert!((reference_a - 16.0).abs() < 0.01, "{reference_a}");
}

#[test]
fn a_coasting_shaft_is_reported_while_the_bridge_is_off() {
    for rpm in [3000.0, -3000.0] {
        let mut motor = Coasting::new(&[], rpm);
        for _ in 0..2000 {
            assert_eq!(motor.step(Setpoint::Stop), Bridge::Off);
        }
        assert_eq!(motor.bench.phase(), Phase::Idle);
        assert!(
            (motor.seen_rpm() - rpm).abs() < 30.0,
            "{}",
            motor.seen_rpm()
        );
        // A fault does not hide it.
        for _ in 0..2000 {
            let hot = Setpoint::Fault(Fault::OverTemperature);
            assert_eq!(motor.step(hot), Bridge::Off);
        }
        assert!(
            (motor.seen_rpm() - rpm).abs() < 30.0,
            "{}",
            motor.seen_rpm()
        );
    }
}

#[test]
fn a_start_begins_with_offsets_measured_anew() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    for offset_a in [0.5, -0.7] {
        let off = sample([offset_a, 0.0, -offset_a], 24.0);
        assert_eq!(
            bench.run(133, off, turn),
            Bridge::Charge(bench.config.charge.duty)
        );
        assert_eq!(bench.phase(), Phase::Charge);
        bench.run(30, off, turn);
        assert_eq!(bench.phase(), Phase::Park);
        let i = bench.state.snapshot().i;
        let amperes = bench
            .config
            .scale
            .amperes(i.d)
            .hypot(bench.config.scale.amperes(i.q));
        // 128 readings at 2^-16 counts each.
        assert!(amperes < 1e-3, "{amperes}");
        bench.run(2, off, Setpoint::Stop);
    }
}

#[test]
fn an_offset_beyond_a_tenth_of_the_range_is_a_fault() {
    // 4 A of ±40 A.
    for (amperes, sound) in [(3.9, true), (-3.9, true), (4.1, false), (-4.1, false)] {
        for phase in 0..3 {
            let mut bench = Bench::new(&[]);
            let turn = bench.turn();
            let mut currents = [0.0; 3];
            currents[phase] = amperes;
            let bridge = bench.run(132, sample(currents, 24.0), turn);
            let fault = bench.faults().contains(Fault::CurrentSensor);
            assert_eq!(fault, !sound, "{phase}: {amperes} A");
            assert_eq!(matches!(bridge, Bridge::Charge(_)), sound);
            if !sound {
                // It holds the bridge off until zero throttle has lasted 0.3 s.
                bench.quiet(bench.periods(0.5), turn);
                assert_eq!(bench.phase(), Phase::Idle);
                bench.quiet(bench.periods(0.32), Setpoint::Zero);
                assert!(bench.faults().is_empty());
                bench.until(Phase::Park, turn);
            }
        }
    }
}

#[test]
fn terminals_that_tell_nothing_delay_a_start_by_40_ms() {
    let mut bench = Bench::new(&[]);
    let turn = bench.turn();
    // Three equal readings are no back-EMF, nor a standing rotor.
    let stuck = Sample {
        terminals: [AdcCounts::from_num(800); 3],
        ..sample([0.0; 3], 24.0)
    };
    let mut periods = 0;
    while bench.state.phase != Phase::Charge {
        assert_eq!(bench.run(1, stuck, turn), Bridge::Off);
        periods += 1;
    }
    assert_eq!(bench.state.off.rotor, Rotor::Unknown);
    // Two periods for the current to decay, and eight measurements, each judged in a period of its own.
    assert_eq!(periods, 2 + 8 * (128 + 1));
}

#[test]
fn the_speed_at_a_fault_is_reported_until_the_terminals_tell_another() {
    let tripped = |terminals| {
        let mut bench = Bench::new(&[]);
        let hot = Setpoint::Fault(Fault::OverTemperature);
        bench.state.phase = Phase::Run;
        bench.state.shared.seen.speed = bench.config.scale.speed_from_rpm(3000.0);
        let sample = Sample {
            terminals,
            ..sample([0.0; 3], 24.0)
        };
        let seconds = [0.0001, 0.02, 2.0 - 0.0201];
        seconds.map(|s| {
            bench.run(bench.periods(s), sample, hot);
            bench.config.scale.rpm(bench.state.snapshot().speed)
        })
    };
    // They are at ground: the rotor is known to stand within 20 ms.
    let [at_once, soon, _] = tripped([AdcCounts::ZERO; 3]);
    assert!((at_once - 3000.0).abs() < 1.0, "{at_once}");
    assert!(soon.abs() < 1e-3, "{soon}");
    // They show nothing usable: it decays as a large propeller coasts, by e in 2 s.
    let [at_once, _, late] = tripped([AdcCounts::from_num(800); 3]);
    assert!((at_once - 3000.0).abs() < 1.0, "{at_once}");
    assert!((late - 3000.0 / 1.0_f32.exp()).abs() < 20.0, "{late}");
}
