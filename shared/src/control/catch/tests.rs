use core::f64::consts::TAU;
use proptest::prelude::*;
use siskin_params::{BOSSO_BENCH, Board, ParamId, Params};

use super::*;
use crate::build::build;

const POLE_PAIRS: f64 = 12.0;
const FLUX_WB: f64 = 1.3e-3;

/// The terminals' dividers and ADC.
#[derive(Clone, Copy)]
struct Dividers {
    v_per_count: f64,
    noise_counts: f64,
    diode_v: f64,
}

/// 70 V on 4096 counts.
const BENCH: Dividers = Dividers {
    v_per_count: 70.0 / 4096.0,
    noise_counts: 2.0,
    diode_v: 0.7,
};

/// 2.2 kΩ of 12.2 kΩ on 3.3 V: full scale is 18.3 V.
const B_G431B: Dividers = Dividers {
    v_per_count: 3.3 / 4096.0 * 12.2 / 2.2,
    ..BENCH
};

/// A motor with floating terminals.
struct Coasting {
    dividers: Dividers,
    period_s: f64,
    omega_rad_s: f64,
    theta: f64,
    random: u64,
}

impl Coasting {
    fn new(dividers: Dividers, pwm_hz: f64, rpm: f64, seed: u64) -> Self {
        let mut motor = Self {
            dividers,
            period_s: 1.0 / pwm_hz,
            omega_rad_s: rpm * POLE_PAIRS * TAU / 60.0,
            theta: 0.0,
            random: 0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(seed + 1),
        };
        motor.theta = TAU * motor.uniform();
        motor
    }

    /// Returns 0 to 1, by a xorshift generator.
    fn uniform(&mut self) -> f64 {
        for _ in 0..4 {
            self.random ^= self.random << 13;
            self.random ^= self.random >> 7;
            self.random ^= self.random << 17;
        }
        (self.random >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Returns unit variance: the sum of twelve uniform numbers.
    fn gaussian(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }

    /// Returns the ADC's readings at this sample.
    fn read(&mut self) -> [AdcCounts; 3] {
        let Dividers {
            v_per_count,
            noise_counts,
            diode_v,
        } = self.dividers;
        let emf = [0.0, 1.0, 2.0]
            .map(|phase| -self.omega_rad_s * FLUX_WB * (self.theta - phase * TAU / 3.0).sin());
        let lowest = emf.into_iter().fold(f64::INFINITY, f64::min);
        let lift = (-lowest - diode_v).max(0.0);
        emf.map(|e| {
            let counts = (e + lift) / v_per_count + noise_counts * self.gaussian();
            AdcCounts::from_num(counts.round().clamp(0.0, 4095.0))
        })
    }

    fn turn(&mut self) {
        self.theta += self.omega_rad_s * self.period_s;
    }

    /// Returns the electrical degrees from the truth, and the speed's relative error.
    fn errors(&self, theta: Angle, omega: Speed) -> (f64, f64) {
        let angle = theta.to_num::<f64>() - self.theta / TAU;
        let speed = omega.to_num::<f64>() * TAU / (self.omega_rad_s * self.period_s) - 1.0;
        (
            ((angle + 0.5).rem_euclid(1.0) - 0.5).abs() * 360.0,
            speed.abs(),
        )
    }
}

fn config(dividers: Dividers, pwm_hz: f64, flux_share: f64) -> Config {
    let mut params = Params::of(&BOSSO_BENCH);
    let flux_mwb = (1e3 * FLUX_WB * flux_share) as f32;
    params
        .set(ParamId::PwmFreqHz, pwm_hz as f32)
        .expect("in range");
    params.set(ParamId::MotFluxMwb, flux_mwb).expect("in range");
    let board = Board {
        terminal_v_per_count: dividers.v_per_count as f32,
        ..Board::BENCH
    };
    build(&params, &board).expect("it fits the bench").catch
}

/// Results of an observation.
#[derive(Default)]
struct Seen {
    /// When the rotor was first known, s.
    known_s: Option<f64>,
    /// Worst errors while known: electrical degrees, share of the speed.
    angle_deg: f64,
    speed: f64,
    /// Worst share of the speed after 8 ms.
    speed_after_8_ms: f64,
    /// Samples at which a known rotor was lost again.
    lapses: u32,
}

/// Observes for a while; `each` changes the motor from sample to sample.
fn watch(
    config: &Config,
    motor: &mut Coasting,
    for_s: f64,
    mut each: impl FnMut(&mut Coasting),
) -> Seen {
    let mut state = State::new(config);
    let mut seen = Seen::default();
    for sample in 0..(for_s / motor.period_s) as u32 {
        let now_s = f64::from(sample) * motor.period_s;
        let readings = motor.read();
        match observe(config, &mut state, readings) {
            Rotor::Turning { theta, omega } => {
                let (angle_deg, speed) = motor.errors(theta, omega);
                seen.known_s.get_or_insert(now_s);
                seen.angle_deg = seen.angle_deg.max(angle_deg);
                seen.speed = seen.speed.max(speed);
                if now_s >= 0.008 {
                    seen.speed_after_8_ms = seen.speed_after_8_ms.max(speed);
                }
            }
            _ if seen.known_s.is_some() => seen.lapses += 1,
            _ => {}
        }
        motor.turn();
        each(motor);
    }
    seen
}

fn electrical_turn_s(rpm: f64) -> f64 {
    60.0 / (rpm * POLE_PAIRS)
}

#[test]
fn a_turning_rotor_is_known_within_a_turn() {
    for dividers in [BENCH, B_G431B] {
        for pwm_hz in [15_000.0, 24_000.0] {
            let config = config(dividers, pwm_hz, 1.0);
            for rpm in [300.0, 450.0, 1000.0, 3000.0, 6000.0] {
                for seed in 0..40 {
                    let signed = if seed % 2 == 0 { rpm } else { -rpm };
                    let mut motor = Coasting::new(dividers, pwm_hz, signed, seed);
                    let seen = watch(&config, &mut motor, 0.06, |_| {});
                    let case = std::format!("{signed} rpm, {pwm_hz} Hz, seed {seed}");
                    let known_s = seen.known_s.expect(&case);
                    // Plus the millisecond in which all must fit.
                    assert!(
                        known_s < electrical_turn_s(rpm) + 0.001,
                        "{case}: {known_s}"
                    );
                    assert!(seen.angle_deg < 10.0, "{case}: {} deg", seen.angle_deg);
                    // Known means a standard deviation of 1 %; later it must be better.
                    assert!(seen.speed < 0.04, "{case}: {}", seen.speed);
                    if rpm > 300.0 {
                        assert!(
                            seen.speed_after_8_ms < 0.02,
                            "{case}: {}",
                            seen.speed_after_8_ms
                        );
                    }
                    assert_eq!(seen.lapses, 0, "{case}");
                }
            }
        }
    }
}

#[test]
fn a_slow_rotor_takes_longer() {
    // At 100 rpm the bench's ADC sees 9.6 counts in 2 of noise.
    for (dividers, rpm, turns, speed) in [
        (B_G431B, 100.0, 1.0, 0.04),
        (BENCH, 150.0, 2.0, 0.06),
        (BENCH, 100.0, 4.0, 0.15),
    ] {
        let config = config(dividers, 24_000.0, 1.0);
        for seed in 0..40 {
            let signed = if seed % 2 == 0 { rpm } else { -rpm };
            let mut motor = Coasting::new(dividers, 24_000.0, signed, seed);
            let seen = watch(&config, &mut motor, 0.3, |_| {});
            let case = std::format!("{signed} rpm, seed {seed}");
            let known_s = seen.known_s.expect(&case);
            assert!(
                known_s < turns * electrical_turn_s(rpm),
                "{case}: {known_s}"
            );
            assert!(seen.angle_deg < 15.0, "{case}: {} deg", seen.angle_deg);
            assert!(seen.speed < speed, "{case}: {}", seen.speed);
        }
    }
}

#[test]
fn a_wrong_flux_and_another_diode_do_not_matter() {
    for (flux_share, diode_v) in [(0.6, 0.5), (1.4, 0.5), (0.6, 0.9), (1.4, 0.9)] {
        let dividers = Dividers { diode_v, ..BENCH };
        let config = config(dividers, 24_000.0, flux_share);
        for rpm in [300.0, -600.0, 1000.0, -3000.0, 6000.0] {
            for seed in 0..10 {
                let mut motor = Coasting::new(dividers, 24_000.0, rpm, seed);
                let seen = watch(&config, &mut motor, 0.06, |_| {});
                let case = std::format!("{rpm} rpm, flux {flux_share}, diode {diode_v} V, {seed}");
                assert!(seen.known_s.expect(&case) < 0.02, "{case}");
                assert!(seen.angle_deg < 10.0, "{case}: {} deg", seen.angle_deg);
                assert!(
                    seen.speed_after_8_ms < 0.04,
                    "{case}: {}",
                    seen.speed_after_8_ms
                );
            }
        }
    }
}

#[test]
fn what_is_beyond_the_dividers_range_is_left_out() {
    // 8000 rpm give 13 V per phase, 22 V from lowest to highest.
    for pwm_hz in [15_000.0, 24_000.0] {
        let config = config(B_G431B, pwm_hz, 1.0);
        for seed in 0..40 {
            let rpm = if seed % 2 == 0 { 8000.0 } else { -8000.0 };
            let mut motor = Coasting::new(B_G431B, pwm_hz, rpm, seed);
            let seen = watch(&config, &mut motor, 0.06, |_| {});
            assert!(seen.known_s.expect("known") < 0.008, "seed {seed}");
            assert!(seen.angle_deg < 10.0, "seed {seed}: {}", seen.angle_deg);
            assert!(seen.speed < 0.02, "seed {seed}: {}", seen.speed);
        }
    }
}

#[test]
fn a_resting_rotor_stands_within_ten_milliseconds_and_stays() {
    for dividers in [BENCH, B_G431B] {
        for pwm_hz in [15_000.0, 24_000.0] {
            let config = config(dividers, pwm_hz, 1.0);
            for seed in 0..20 {
                let mut motor = Coasting::new(dividers, pwm_hz, 0.0, seed);
                let mut state = State::new(&config);
                for sample in 0..(pwm_hz as u32) / 4 {
                    let rotor = observe(&config, &mut state, motor.read());
                    let late = f64::from(sample) >= 0.01 * pwm_hz;
                    let wanted = if late { Rotor::Standing } else { rotor };
                    assert_eq!(rotor, wanted, "seed {seed}, sample {sample}");
                    assert!(!matches!(rotor, Rotor::Turning { .. }), "seed {seed}");
                }
            }
        }
    }
}

#[test]
fn a_coasting_propeller_is_followed_until_it_stands() {
    for pwm_hz in [15_000.0, 24_000.0] {
        let config = config(BENCH, pwm_hz, 1.0);
        for seed in 0..4 {
            let mut motor = Coasting::new(BENCH, pwm_hz, 6000.0, seed);
            let mut state = State::new(&config);
            let rpm_per_rad_s = 60.0 / (TAU * POLE_PAIRS);
            let mut stands = false;
            for sample in 0..(6.0 * pwm_hz) as u32 {
                let rpm = motor.omega_rad_s * rpm_per_rad_s;
                let rotor = observe(&config, &mut state, motor.read());
                stands = rotor == Rotor::Standing;
                if let Rotor::Turning { theta, omega } = rotor {
                    let (angle_deg, speed) = motor.errors(theta, omega);
                    let case = std::format!("{rpm} rpm, seed {seed}");
                    assert!(rpm < 300.0 || angle_deg < 10.0, "{case}: {angle_deg} deg");
                    // A memory of one turn lags by up to twice that.
                    let lag = 2.0 * electrical_turn_s(rpm) / 1.1;
                    assert!(rpm < 150.0 || speed < 0.02 + lag, "{case}: {speed}");
                } else {
                    assert!(
                        rpm < 250.0 || sample < 100,
                        "{rpm} rpm, seed {seed}: {rotor:?}"
                    );
                }
                motor.turn();
                // The bench's time constant of 1.1 s all the way down; a propeller's grows.
                motor.omega_rad_s *= 1.0 - motor.period_s / 1.1;
            }
            assert!(stands, "seed {seed}");
        }
    }
}

#[test]
fn a_terminal_that_is_stuck_is_not_a_turning_rotor() {
    let config = config(BENCH, 24_000.0, 1.0);
    for (phase, stuck) in [(0, 0), (1, 0), (2, 4095), (0, 4095)] {
        for rpm in [1000.0, 4000.0] {
            let mut motor = Coasting::new(BENCH, 24_000.0, rpm, 1);
            let mut state = State::new(&config);
            for sample in 0..4800 {
                let mut readings = motor.read();
                readings[phase] = AdcCounts::from_num(stuck);
                let rotor = observe(&config, &mut state, readings);
                let known = matches!(rotor, Rotor::Turning { .. });
                assert!(
                    !known,
                    "phase {phase} at {stuck}, {rpm} rpm, sample {sample}"
                );
                motor.turn();
            }
        }
    }
}

proptest! {
    #[test]
    fn no_reading_overflows(
        readings in proptest::collection::vec(any::<[i32; 3]>(), 1..200),
        shift in 0..32,
    ) {
        let config = config(BENCH, 8_000.0, 1.0);
        let mut state = State::new(&config);
        for reading in readings {
            let rotor = observe(&config, &mut state, reading.map(|x| AdcCounts::from_bits(x >> shift)));
            let seen = state.level >= config.standing;
            prop_assert_eq!(rotor == Rotor::Standing, !seen);
            if matches!(rotor, Rotor::Turning { .. }) {
                prop_assert!(state.fits >= config.sure_looks);
            }
        }
    }
}
