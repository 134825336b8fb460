//! Inductance adaptation on a flux estimate like an observer's.

use siskin_params::ParamId;
use siskin_units::Flux;

use super::{L, PHI, TS, Units, config_with};
use crate::control::inductance::{Factor, State, step};

use fixed::types::I2F30;

struct Bench {
    units: Units,
    state: State,
    i_d: f64,
    flux: f64,
    noise: u32,
}

impl Bench {
    fn new() -> Self {
        Self {
            units: Units(config_with(&[(ParamId::CtlAdaptL, 1.0)])),
            state: State::default(),
            i_d: 0.0,
            flux: PHI,
            noise: 1,
        }
    }

    /// Returns uniform noise of this standard deviation.
    fn noise(&mut self, deviation: f64) -> f64 {
        self.noise = self
            .noise
            .wrapping_mul(1_664_525)
            .wrapping_add(1_013_904_223);
        (f64::from(self.noise >> 8) / f64::from(1 << 24) - 0.5) * 12_f64.sqrt() * deviation
    }

    /// Runs a period on a motor of this L: the current follows in 0.4 ms, the observer's flux in
    /// 1.2 ms, as at 4500 rpm. Returns the offset to i_d*, A.
    fn period(&mut self, inductance_h: f64) -> f64 {
        let config = self.units.0.adapt_l.clone().expect("it is on");
        let measured = self.i_d + self.noise(0.05);
        let flux = self.flux + self.noise(2e-6);
        let unit = f64::from(self.units.0.scale.flux_wb());
        let i_star = step(
            &config,
            &mut self.state,
            self.units.current(measured),
            Flux::from_num(flux / unit),
        );
        let i_star = self.units.amperes(i_star);
        self.i_d += (i_star - self.i_d) * TS / 0.4e-3;
        let factor = self.state.factor.get().to_num::<f64>();
        let seen = PHI + (inductance_h - factor * L) * self.i_d;
        self.flux += (seen - self.flux) * TS / 1.2e-3;
        i_star
    }
}

#[test]
fn the_wave_is_an_ampere_at_fifty_hertz() {
    let mut bench = Bench::new();
    let wave: std::vec::Vec<f64> = (0..1500).map(|_| bench.period(L)).collect();
    assert!(wave.iter().all(|i| (i.abs() - 1.0).abs() < 1e-4));
    let edges = wave.windows(2).filter(|pair| pair[0] != pair[1]).count();
    // 0.1 s.
    assert!((9..=10).contains(&edges), "{edges}");
    assert!(wave.iter().sum::<f64>().abs() < 151.0);
}

#[test]
fn a_stated_inductance_that_is_wrong_by_thirty_percent_is_found_in_three_tenths_of_a_second() {
    for wrong in [0.7, 1.0, 1.3] {
        let mut bench = Bench::new();
        // Actual over stated.
        let truth = 1.0 / wrong;
        for _ in 0..(0.3 / TS) as usize {
            bench.period(truth * L);
        }
        let factor = bench.state.factor.get().to_num::<f64>();
        assert!((factor / truth - 1.0).abs() < 0.04, "{wrong}: {factor}");
    }
}

#[test]
fn the_factor_stays_within_its_range() {
    for (truth, end) in [(0.1, 0.5), (5.0, 1.7)] {
        let mut bench = Bench::new();
        for _ in 0..(2.0 / TS) as usize {
            bench.period(truth * L);
            let factor = bench.state.factor.get().to_num::<f64>();
            assert!((0.5 - 1e-6..=1.7 + 1e-6).contains(&factor));
        }
        let factor = bench.state.factor.get().to_num::<f64>();
        assert!((factor - end).abs() < 0.01, "{truth}: {factor}");
    }
}

#[test]
fn a_current_that_does_not_follow_the_wave_says_nothing() {
    let mut bench = Bench::new();
    let config = bench.units.0.adapt_l.clone().expect("it is on");
    for period in 0..6000 {
        let flux = Flux::from_num(if period / 150 % 2 == 0 { 0.5 } else { 0.7 });
        let i_d = bench.units.current(3.0);
        step(&config, &mut bench.state, i_d, flux);
    }
    assert_eq!(bench.state.factor, Factor::ONE);
}

#[test]
fn a_factor_multiplies_and_holds_the_ends() {
    let factor = Factor::new(I2F30::from_num(1.25));
    let x = Flux::from_num(-2.0);
    assert!((factor.of(x).to_num::<f64>() + 2.5).abs() < 1e-7);
    let most = Factor::new(I2F30::from_num(1.9)).of(Flux::MAX);
    assert!(most > Flux::from_num(7.99));
    assert!((Factor::new(I2F30::ZERO).get().to_num::<f64>() - 0.5).abs() < 1e-9);
}
