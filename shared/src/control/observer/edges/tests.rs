//! The whole estimation on a motor in double precision that turns as commanded.

use proptest::prelude::*;
use std::f64::consts::TAU;
use std::vec::Vec;

use siskin_params::{BOSSO_BENCH, Board, ParamId, Params, parts};
use siskin_units::Scale;

use super::*;
use crate::build::build;
use crate::control::observer::{self, sector::Sector};

const CROSSINGS: Sensors = Sensors::None(parts::FluxCrossings::HERE);
const HALL: Sensors = Sensors::Hall(parts::Hall::HERE);
const MERGED: Sensors = Sensors::Merged(parts::Hall::HERE, parts::FluxCrossings::HERE);

const R: f64 = 0.108;
const L: f64 = 30.6e-6;
const PHI: f64 = 1.3e-3;
const P: f64 = 12.0;
const TS: f64 = 1.0 / 24_000.0;

/// The rotor's flux and the q current, as seen by three phases, and three sensors.
struct Bench {
    config: Config,
    scale: Scale,
    state: State,
    /// Mechanical rpm.
    rpm: f64,
    /// Electrical turns.
    turns: f64,
    i_q: f64,
    linked: [f64; 3],
    i: [f64; 3],
    /// Noise of the current sensors, A rms.
    noise_a: f64,
    random: u64,
    /// Lead of the sensors over the phases, degrees.
    hall_deg: f64,
    /// Their code when faulty.
    spoil: fn(u8) -> u8,
}

fn three(length: f64, turns: f64) -> [f64; 3] {
    [0.0, -1.0, 1.0].map(|third| length * (TAU * (turns + third / 3.0)).cos())
}

impl Bench {
    fn new(sensors: Sensors, changes: &[(ParamId, f32)]) -> Self {
        let mut params = Params::of(&BOSSO_BENCH);
        for (id, value) in changes {
            params.set(*id, *value).expect("in range");
        }
        let observer = match sensors {
            Sensors::None(_) => 1.0,
            Sensors::Hall(_) | Sensors::Merged(..) => 2.0,
        };
        params
            .set(ParamId::CtlObserver, observer)
            .expect("in range");
        let hall = f32::from(u8::from(sensors != HALL));
        params.set(ParamId::CtlHall, hall).expect("in range");
        let config = build(&params, &Board::BENCH).expect("the defaults fit");
        let observer::Config::Edges(edges) = config.observer else {
            panic!("it is one by edges");
        };
        assert_eq!(edges.sensors, sensors);
        Self {
            config: edges,
            scale: config.scale,
            state: State::default(),
            rpm: 0.0,
            turns: 0.0,
            i_q: 0.0,
            linked: three(PHI, 0.0),
            i: [0.0; 3],
            noise_a: 0.0,
            random: 1,
            hall_deg: 0.0,
            spoil: |code| code,
        }
    }

    /// Returns a running motor and an estimation that knows it.
    fn running(sensors: Sensors, changes: &[(ParamId, f32)], rpm: f64) -> Self {
        let mut bench = Self::new(sensors, changes);
        bench.rpm = rpm;
        // A sensor code must last.
        bench.step();
        bench.step();
        bench.begin();
        bench.run(1.0);
        bench
    }

    fn begin(&mut self) {
        let theta = Angle::wrapping_from_num(self.turns);
        let omega = self.scale.speed_from_rpm(self.rpm as f32);
        let i = self
            .i
            .map(|a| Current::from_num(a / f64::from(self.scale.current_a)));
        begin(&self.config, &mut self.state, theta, omega, i);
    }

    fn step(&mut self) -> Position {
        self.turns += self.rpm * P / 60.0 * TS;
        let i = three(self.i_q, self.turns + 0.25);
        let rotor = three(PHI, self.turns);
        let linked = [0, 1, 2].map(|k| rotor[k] + L * i[k]);
        let v = [0, 1, 2].map(|k| {
            let drop = R * (i[k] + self.i[k]) / 2.0;
            let volts = (linked[k] - self.linked[k]) / TS + drop;
            Voltage::from_num(volts / f64::from(self.scale.voltage_v))
        });
        (self.i, self.linked) = (i, linked);
        let sensed = Angle::wrapping_from_num(self.turns + self.hall_deg / 360.0);
        let hall = (self.spoil)(Sector::of(sensed).code());
        let read = i.map(|a| a + self.noise());
        let i = read.map(|a| Current::from_num(a / f64::from(self.scale.current_a)));
        estimate(&self.config, &mut self.state, v, i, hall)
    }

    /// Returns nearly normal noise: the sum of twelve uniform numbers.
    fn noise(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.random = self
                .random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            sum += (self.random >> 32) as f64 / 4_294_967_296.0;
        }
        self.noise_a * sum
    }

    fn error_deg(&self, position: &Position) -> f64 {
        let truth = Angle::wrapping_from_num(self.turns);
        position.theta.wrapping_sub(truth).to_num::<f64>() * 360.0
    }

    /// Returns the largest angle error over this many seconds; the position must be known throughout.
    fn run(&mut self, seconds: f64) -> f64 {
        self.ramp(0.0, seconds)
    }

    /// Runs while the speed changes by this many rpm per second; returns the largest angle error.
    fn ramp(&mut self, rpm_s: f64, seconds: f64) -> f64 {
        let mut worst = 0.0_f64;
        for _ in 0..(seconds / TS).round() as u32 {
            self.rpm += rpm_s * TS;
            let position = self.step();
            assert!(position.known, "lost at {} rpm", self.rpm);
            worst = worst.max(self.error_deg(&position).abs());
        }
        worst
    }
}

#[test]
fn at_a_steady_speed_lead_and_delays_are_compensated() {
    for form in [0.0, 1.0, 2.0, 3.0] {
        for rpm in [150.0, 300.0, 1000.0, 3000.0, 6000.0] {
            let mut bench = Bench::new(CROSSINGS, &[(ParamId::CtlFluxForm, form)]);
            bench.rpm = rpm;
            bench.begin();
            bench.run(2.0);
            let worst = bench.run(0.2);
            // A sine between two samples of a crossing is treated as a line.
            assert!(worst < 0.5, "form {form}, {rpm} rpm: {worst}");
        }
    }
}

#[test]
fn current_costs_at_most_what_the_integrators_do_to_its_flux() {
    for rpm in [300.0, 1000.0, 6000.0] {
        let mut bench = Bench::running(CROSSINGS, &[], rpm);
        bench.i_q = 15.0;
        bench.run(2.0);
        let worst = bench.run(0.2);
        // L·i is 0.35 φ at a right angle; what the filter adds to it, (F − 1)·L·i with |F − 1| = sin(lead), turns
        // λ̂ by at most the square of that.
        let lead = 5.5_f64.to_radians() * 300.0 / rpm;
        let bound = 0.5 + (0.36 * lead * lead).to_degrees();
        assert!(worst < bound, "{rpm}: {worst} of {bound}");
    }
}

#[test]
fn a_wrong_inductance_turns_the_angle_by_the_papers_amount_and_a_wrong_resistance_hardly() {
    let error = |id: ParamId, value: f64, rpm: f64| {
        let mut bench = Bench::new(CROSSINGS, &[(id, value as f32)]);
        bench.rpm = rpm;
        bench.begin();
        bench.i_q = 15.0;
        bench.run(1.0);
        let position = bench.step();
        bench.error_deg(&position)
    };
    for share in [-0.3, 0.3] {
        // Δθ = −arctan(I·ΔL/λ) (2.5.1), the current being at a right angle to the true flux.
        let wanted = -(15.0 * share * L / PHI).atan().to_degrees();
        let got = error(ParamId::MotLUh, (1.0 + share) * L * 1e6, 3000.0);
        assert!((got - wanted).abs() < 0.5, "{got}, {wanted}");
        // It changes the length: by 10 % at this speed.
        let got = error(ParamId::MotRMohm, (1.0 + share) * R * 1e3, 3000.0);
        assert!(got.abs() < 1.0, "{got}");
    }
}

#[test]
fn noise_of_the_sensors_moves_the_angle_by_a_degree_or_two() {
    for rpm in [300.0, 1000.0, 6000.0] {
        let mut bench = Bench::running(CROSSINGS, &[], rpm);
        bench.noise_a = 0.05;
        let worst = bench.run(0.5);
        // 0.05 A·(R·T_s·√(τ/2T_s) + L) of the flux is 0.2°; five times that at worst.
        assert!(worst < 2.0, "{rpm}: {worst}");
    }
}

#[test]
fn accelerating_as_hard_as_the_drive_may_keeps_the_error_below_20_degrees() {
    for a_e in [0.0, 0.5, 0.9] {
        let mut bench = Bench::running(CROSSINGS, &[(ParamId::CtlAe, a_e)], 300.0);
        // CTL_SLEW_RPM_S; extrapolation and filter may contribute 10° each.
        let up = bench.ramp(20_000.0, 5_700.0 / 20_000.0);
        let down = bench.ramp(-20_000.0, 5_400.0 / 20_000.0);
        assert!(up < 20.0 && down < 20.0, "{a_e}: {up}, {down}");
    }
}

#[test]
fn a_rotor_that_stops_is_lost_and_one_that_turns_again_is_found() {
    let mut bench = Bench::running(CROSSINGS, &[], 1000.0);
    bench.rpm = 0.0;
    // The patience is two sixths of a turn at 150 rpm.
    let seconds = 2.0 / 6.0 / 30.0 + 0.003;
    let known: Vec<_> = (0..(seconds / TS) as u32)
        .map(|_| bench.step().known)
        .collect();
    assert_eq!(known.last(), Some(&false));
    bench.rpm = 1000.0;
    let found = (0..24_000).position(|_| bench.step().known);
    // A turn takes 120 periods: one turn until the comparator has locked, one of sound crossings, one to flush the
    // standstill from the integrators.
    assert!(found.is_some_and(|periods| periods < 360), "{found:?}");
    bench.run(0.2);
    assert!(bench.run(0.1) < 0.5);
}

#[test]
fn sensors_tell_the_position_at_standstill_at_once() {
    for sensors in [HALL, MERGED] {
        for degrees in 0..360 {
            let mut bench = Bench::new(sensors, &[]);
            bench.turns = f64::from(degrees) / 360.0;
            bench.step();
            let position = bench.step();
            assert!(position.known && position.omega == Speed::ZERO);
            let error = bench.error_deg(&position);
            assert!(error.abs() <= 30.001, "{degrees}: {error}");
        }
    }
}

#[test]
fn sensors_start_a_motor_and_follow_it_to_its_stop() {
    for sensors in [HALL, MERGED] {
        let mut bench = Bench::new(sensors, &[]);
        bench.step();
        bench.step();
        // The ramp's 800 rpm/s.
        let slow = bench.ramp(800.0, 0.2);
        assert!(slow <= 35.0, "up to 160 rpm: {slow}");
        let up = bench.ramp(800.0, 0.9);
        assert!(up < 15.0, "160 to 880 rpm: {up}");
        assert!(bench.run(0.5) < 5.0);
        bench.ramp(-800.0, 1.1);
        bench.rpm = 0.0;
        bench.run(0.1);
        let position = bench.step();
        assert_eq!(position.omega, Speed::ZERO);
        assert!(bench.error_deg(&position).abs() <= 30.001);
    }
}

#[test]
fn flux_crossings_take_over_above_a_speed_and_sensors_below_another() {
    let mut bench = Bench::new(MERGED, &[]);
    // Sensors 12° off: the error tells which source leads.
    bench.hall_deg = 12.0;
    bench.step();
    bench.step();
    bench.ramp(800.0, 0.35);
    assert_eq!(bench.state.source, Source::Hall, "280 rpm");
    bench.ramp(800.0, 0.15);
    assert_eq!(bench.state.source, Source::Flux, "400 rpm");
    bench.run(0.3);
    assert!(bench.run(0.1) < 2.0);
    bench.ramp(-800.0, 0.28);
    assert_eq!(bench.state.source, Source::Flux, "176 rpm");
    bench.ramp(-800.0, 0.1);
    assert_eq!(bench.state.source, Source::Hall, "96 rpm");
    let position = bench.step();
    assert!(!position.sensor_fault && position.known);
}

#[test]
fn a_sensor_that_fails_is_noticed_and_survived() {
    let faults: [fn(u8) -> u8; 5] = [|code| code | 1, |code| code & !2, |_| 7, |_| 0, |_| 0b011];
    for spoil in faults {
        let mut bench = Bench::running(MERGED, &[], 1000.0);
        bench.spoil = spoil;
        // Ten turns.
        let worst = bench.run(0.05);
        assert!(worst < 1.0, "{worst}");
        assert!(bench.step().sensor_fault);
        // Where sensors would take over.
        bench.ramp(-800.0, 1.03);
        assert_eq!(bench.state.source, Source::Flux);
        bench.ramp(800.0, 1.0);
        assert!(bench.run(0.3) < 5.0);
    }
}

#[test]
fn sensors_that_contradict_the_fluxes_are_at_fault() {
    let mut bench = Bench::running(MERGED, &[], 1000.0);
    bench.hall_deg = 150.0;
    assert!(bench.run(0.1) < 1.0);
    assert!(bench.step().sensor_fault);
}

#[test]
fn sensors_that_are_right_are_never_at_fault() {
    let mut bench = Bench::running(MERGED, &[], 200.0);
    for hall_deg in [-15.0, 0.0, 15.0] {
        bench.hall_deg = hall_deg;
        bench.ramp(5_000.0, 1.0);
        bench.ramp(-5_000.0, 1.0);
        assert!(!bench.step().sensor_fault);
    }
}

#[test]
fn alone_a_sensor_that_fails_leaves_the_position_unknown() {
    let mut bench = Bench::running(HALL, &[], 1000.0);
    bench.spoil = |code| code | 4;
    let last = (0..240).map(|_| bench.step()).last().expect("some");
    assert!(last.sensor_fault && !last.known);
}

#[test]
fn at_low_speed_too_a_failed_sensor_is_noticed_and_a_start_without_it_works() {
    let mut bench = Bench::new(MERGED, &[]);
    bench.spoil = |_| 7;
    let last = (0..100).map(|_| bench.step()).last().expect("some");
    assert!(last.sensor_fault && !last.known);
    // The state that a ramp without sensors hands over.
    bench.rpm = 300.0;
    bench.step();
    bench.begin();
    assert!(bench.run(0.5) < 5.0);
    assert!(bench.step().sensor_fault);
}

proptest! {
    #[test]
    fn any_input_is_survived(
        words in prop::collection::vec((any::<[i32; 6]>(), any::<u8>(), 0_u8..50), 1..200),
        merged in any::<bool>(),
    ) {
        let sensors = if merged { MERGED } else { CROSSINGS };
        let mut bench = Bench::new(sensors, &[]);
        for ([a, b, c, d, e, f], hall, what) in words {
            let i = [d, e, f].map(Current::from_bits);
            if what == 0 {
                let theta = Angle::from_bits(a);
                begin(&bench.config, &mut bench.state, theta, Speed::from_bits(b), i);
            }
            let v = [a, b, c].map(Voltage::from_bits);
            let position = estimate(&bench.config, &mut bench.state, v, i, hall);
            prop_assert!(position.omega >= Speed::ZERO);
        }
    }
}
