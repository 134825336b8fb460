//! The estimator against section 2.4.

use proptest::prelude::*;
use std::vec::Vec;

use super::*;

fn config(turns: u8, a_e: f32) -> Config {
    Config {
        turns,
        whole_turns_above: Speed::ZERO,
        a_e: Gain::new(a_e).expect("in range"),
        filter_above: Speed::ZERO,
        compensates: false,
    }
}

fn degrees(angle: Angle) -> f64 {
    angle.to_num::<f64>() * 360.0
}

fn sector(index: u32) -> Sector {
    Sector::of(Angle::wrapping_from_num(f64::from(index) / 6.0))
}

fn edge(config: &Config, state: &mut State, index: u32, late: f64) {
    time_edge(config, state, Periods::from_num(late));
    place_at_edge(config, state, sector(index), Angle::ZERO);
}

/// A rotor at constant speed, with an edge in the sample after each sixth of a turn.
struct Rotor {
    omega: f64,
    sample: u32,
    edges: u32,
}

impl Rotor {
    fn new(omega: f64) -> Self {
        Self {
            omega,
            sample: 0,
            edges: 0,
        }
    }

    /// Runs one sample; returns the edge's time if there was one.
    fn step(&mut self, config: &Config, state: &mut State) -> Option<f64> {
        self.sample += 1;
        advance(state);
        let next = f64::from(self.edges + 1) / 6.0 - 1.0 / 12.0;
        let late = f64::from(self.sample) - next / self.omega;
        if late < 0.0 {
            return None;
        }
        self.edges += 1;
        edge(config, state, self.edges, late);
        Some(late)
    }

    fn error_deg(&self, state: &State) -> f64 {
        let truth = Angle::wrapping_from_num(self.omega * f64::from(self.sample));
        degrees(state.theta.wrapping_sub(truth))
    }
}

proptest! {
    #[test]
    fn the_speed_is_that_of_n_turns(omega in 0.0005..0.11_f64, turns in 1_u8..=4) {
        let config = config(turns, 0.0);
        let mut state = State::default();
        let mut rotor = Rotor::new(omega);
        while rotor.edges < 6 * u32::from(turns) {
            rotor.step(&config, &mut state);
            prop_assert_eq!(state.omega, Speed::ZERO);
        }
        // The first edge starts the measurement, which takes 6N more.
        while rotor.edges < 6 * u32::from(turns) + 1 {
            rotor.step(&config, &mut state);
        }
        let found = state.omega.to_num::<f64>();
        // Each of two times is known to 2^-12 of a period.
        let bound = omega * (2.0_f64.powi(-11) * omega / f64::from(turns) + 1e-6) + 1e-9;
        prop_assert!((found - omega).abs() <= bound, "{} instead of {}", found, omega);
    }

    #[test]
    fn with_compensation_the_angle_is_right_between_the_edges(
        omega in 0.0005..0.11_f64,
        a_e in 0.0..0.9_f32,
    ) {
        let config = Config { compensates: true, ..config(1, a_e) };
        let mut state = State::default();
        let mut rotor = Rotor::new(omega);
        for _ in 0..(20.0 / omega) as u32 {
            rotor.step(&config, &mut state);
        }
        prop_assert!(rotor.error_deg(&state).abs() < 0.2, "{}", rotor.error_deg(&state));
    }

    #[test]
    fn without_it_the_angle_lags_by_at_most_a_period(omega in 0.0005..0.11_f64) {
        let config = config(1, 0.0);
        let mut state = State::default();
        let mut rotor = Rotor::new(omega);
        for k in 0..(20.0 / omega) as u32 {
            rotor.step(&config, &mut state);
            if f64::from(k) * omega > 3.0 {
                let error = rotor.error_deg(&state);
                prop_assert!(error < 0.1 && error > -360.0 * omega - 0.1, "{}", error);
            }
        }
    }

    #[test]
    fn any_input_is_survived(
        words in prop::collection::vec((any::<[u32; 3]>(), 0_u8..6, 1_u8..40), 1..60),
        turns in any::<u8>(),
    ) {
        let config = Config { compensates: true, whole_turns_above: Speed::from_num(0.001), ..config(turns, 0.95) };
        let mut state = State::default();
        for ([a, b, c], what, times) in words {
            (0..times).for_each(|_| advance(&mut state));
            match what {
                0 => begin(&mut state, Angle::from_bits(a as i32), Speed::from_bits(b as i32)),
                1 => set_to_rest(&mut state, sector(a % 6)),
                2 => set_angle(&mut state, Angle::from_bits(a as i32)),
                3 => state.since = u32::MAX - 1,
                _ => {
                    time_edge(&config, &mut state, Periods::from_bits(b % 6145));
                    place_at_edge(&config, &mut state, sector(a % 6), Angle::from_bits(c as i32));
                }
            }
            prop_assert!((Angle::ZERO..=LIMIT).contains(&state.theta_inc), "{}", state.theta_inc);
            let fastest = Speed::from_bits(OMEGA_MAX as i32);
            prop_assert!((Speed::ZERO..=fastest).contains(&state.omega), "{}", state.omega);
        }
    }
}

#[test]
fn extrapolation_is_linear_and_ends_at_90_degrees() {
    let mut state = State::default();
    begin(&mut state, Angle::ZERO, Speed::from_num(0.01));
    for k in 1..=25 {
        advance(&mut state);
        assert!((degrees(state.theta) - 3.6 * f64::from(k)).abs() < 1e-5);
    }
    for _ in 0..50 {
        advance(&mut state);
        assert!((degrees(state.theta) - 90.0).abs() < 1e-5);
        assert!((degrees(state.theta_inc) - 90.0).abs() < 1e-5);
    }
}

#[test]
fn the_speed_of_a_rotor_that_stops_is_never_above_what_the_missing_edge_allows() {
    let config = config(1, 0.0);
    let mut state = State::default();
    let mut rotor = Rotor::new(0.01);
    for _ in 0..400 {
        rotor.step(&config, &mut state);
    }
    for _ in 0..10_000 {
        advance(&mut state);
        // A sixth of a turn, doubled because of the halving.
        let most = 2.0 / 6.0 / f64::from(state.since);
        assert!(state.omega.to_num::<f64>() <= most.max(1e-7) || state.since < 34);
    }
}

#[test]
fn the_filter_leaves_the_share_a_e_of_the_extrapolated_angle() {
    for a_e in [0.0, 0.5, 0.9] {
        let config = config(1, a_e);
        let mut state = State::default();
        begin(
            &mut state,
            Angle::from_num(40.0 / 360.0),
            Speed::from_num(0.01),
        );
        // The second sector begins at 30°: the extrapolated angle is 10° too far.
        edge(&config, &mut state, 1, 0.0);
        let wanted = 30.0 + 10.0 * f64::from(a_e);
        assert!((degrees(state.theta) - wanted).abs() < 1e-4);
        let slow = Config {
            filter_above: Speed::from_num(0.02),
            ..config
        };
        begin(
            &mut state,
            Angle::from_num(40.0 / 360.0),
            Speed::from_num(0.01),
        );
        edge(&slow, &mut state, 1, 0.0);
        assert!((degrees(state.theta) - 30.0).abs() < 1e-4);
    }
}

#[test]
fn every_edge_measures_the_last_turns() {
    for turns in 1..=TURNS_MAX {
        let config = config(turns, 0.0);
        let mut state = State::default();
        let mut intervals = Vec::new();
        edge(&config, &mut state, 0, 0.0);
        for index in 1..200 {
            let periods = 10 + (index * 7) % 13;
            (0..periods).for_each(|_| advance(&mut state));
            intervals.push(periods);
            edge(&config, &mut state, index, 0.0);
            let last: u32 = intervals.iter().rev().take(6 * usize::from(turns)).sum();
            let wanted = match intervals.len() < 6 * usize::from(turns) {
                true => 0.0,
                false => f64::from(turns) / f64::from(last),
            };
            assert!((state.omega.to_num::<f64>() - wanted).abs() < 1e-9);
        }
    }
}

#[test]
fn below_a_speed_every_interval_is_a_measurement() {
    let config = Config {
        whole_turns_above: Speed::from_num(0.01),
        ..config(1, 0.0)
    };
    let mut state = State::default();
    edge(&config, &mut state, 0, 0.0);
    for (index, periods) in [(1, 50), (2, 40), (3, 60), (4, 30)] {
        (0..periods).for_each(|_| advance(&mut state));
        edge(&config, &mut state, index, 0.0);
        let wanted = 1.0 / 6.0 / f64::from(periods);
        assert!((state.omega.to_num::<f64>() - wanted).abs() < 1e-9);
    }
    // Faster than 0.01, without a whole turn behind it: the speed stays.
    (0..15).for_each(|_| advance(&mut state));
    edge(&config, &mut state, 5, 0.0);
    assert!((state.omega.to_num::<f64>() - 1.0 / 180.0).abs() < 1e-9);
    (0..15).for_each(|_| advance(&mut state));
    edge(&config, &mut state, 0, 0.0);
    assert!((state.omega.to_num::<f64>() - 1.0 / 210.0).abs() < 1e-9);
}

#[test]
fn the_change_of_the_speed_is_the_acceleration() {
    let config = config(1, 0.0);
    let mut state = State::default();
    begin(&mut state, Angle::ZERO, Speed::from_num(0.01));
    edge(&config, &mut state, 0, 0.0);
    // ω² = ω_0² + 2·α·θ.
    let (omega_0, alpha) = (0.01_f64, 2e-6);
    let time_of = |index: u32| {
        let turns = f64::from(index) / 6.0;
        ((omega_0 * omega_0 + 2.0 * alpha * turns).sqrt() - omega_0) / alpha
    };
    let mut sample = 0;
    for index in 1..60 {
        let edge_time = time_of(index);
        while f64::from(sample) < edge_time {
            sample += 1;
            advance(&mut state);
        }
        edge(&config, &mut state, index, f64::from(sample) - edge_time);
        if index > 7 {
            let found = state.omega_step.to_num::<f64>();
            assert!((found / alpha - 1.0).abs() < 0.1, "{found}");
        }
    }
}

#[test]
fn without_a_speed_the_rotor_is_in_the_middle_of_its_sector() {
    let config = config(1, 0.9);
    let mut state = State::default();
    edge(&config, &mut state, 2, 0.0);
    assert!((degrees(state.theta) - 120.0).abs() < 1e-4);
}
