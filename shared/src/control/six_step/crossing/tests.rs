//! The crossing on back-EMF by hand, clamped and quantised.

use super::*;
use core::f64::consts::TAU;

const BUS_V: f64 = 24.0;
const BASE_V: f64 = 80.0;
const COUNT_V: f64 = 70.0 / 4096.0;

fn config() -> Config {
    Config {
        least: Voltage::from_num(0.05 / BASE_V),
        greatest: Voltage::from_num(68.0 / BASE_V),
        delayed: 1,
    }
}

/// Looks at a reading with one that is certain, without strictness.
fn see(state: &mut State, rising: bool, reading: Voltage, leg: Leg) -> Option<I16F16> {
    let bus = Voltage::from_num(BUS_V / BASE_V);
    look(&config(), state, rising, false, 1, reading, (leg, bus))
}

/// The terminal voltage for a back-EMF, clamped by the diodes and quantised to counts.
fn terminal(emf_v: f64) -> Voltage {
    let held_v = (1.5 * emf_v).clamp(0.0, BUS_V + 0.7);
    Voltage::from_num((held_v / COUNT_V).round() * COUNT_V / BASE_V)
}

/// Runs one sextant of a motor with this back-EMF, V, and this many periods per sextant, the first sample
/// `offset` periods after its start; the previous phase's current decays for `dies` samples. Returns the error
/// of the crossing's instant, periods.
fn sextant(
    state: &mut State,
    rising: bool,
    (emf_v, sextant_periods, offset): (f64, f64, f64),
    dies: u32,
) -> Option<f64> {
    let config = config();
    state.begin(&config);
    let mut error = None;
    let mut sample = 0;
    loop {
        let t = f64::from(sample) + offset - f64::from(config.delayed);
        if t > sextant_periods {
            return error;
        }
        let from_crossing = t - sextant_periods / 2.0;
        let wave = (from_crossing / sextant_periods * TAU / 6.0).sin();
        let emf_v = if rising { emf_v * wave } else { -emf_v * wave };
        let reading = if t < 0.0 {
            terminal(10.0)
        } else if t < f64::from(dies) {
            terminal(if rising { 100.0 } else { -100.0 })
        } else {
            terminal(emf_v)
        };
        if let Some(age) = see(state, rising, reading, Leg::Low) {
            assert!(error.is_none(), "once a sextant");
            error = Some(t - age.to_num::<f64>() - sextant_periods / 2.0);
        }
        sample += 1;
    }
}

/// Returns (V, periods per sextant) of the bench with 12 pole pairs and 1.3 mWb at 40 kHz.
fn bench(rpm: f64) -> (f64, f64) {
    (
        rpm / 60.0 * 12.0 * TAU * 1.3e-3,
        40_000.0 * 60.0 / (rpm * 72.0),
    )
}

#[test]
fn the_instant_is_found_to_a_degree_from_1000_to_6000_rpm() {
    for rpm in [1000.0, 2000.0, 3000.0, 4500.0, 6000.0] {
        let (emf_v, periods) = bench(rpm);
        let mut state = State::default();
        for i in 0..200 {
            let offset = f64::from(i) * 0.618 % 1.0;
            let dies = u32::from(rpm > 4000.0);
            let error = sextant(&mut state, i % 2 == 0, (emf_v, periods, offset), dies);
            let error_deg = error.expect("it is seen") / periods * 60.0;
            if i >= 4 {
                // Half a count is 0.2° at 1000 rpm; the sine's curvature makes up the rest.
                assert!(error_deg.abs() < 1.0, "{rpm} {i}: {error_deg}");
            }
        }
    }
}

#[test]
fn a_current_that_hides_the_crossing_is_no_crossing_of_a_falling_phase() {
    let (emf_v, periods) = bench(6000.0);
    let mut state = State::default();
    assert_eq!(sextant(&mut state, false, (emf_v, periods, 0.5), 4), None);
    assert!(state.blind());
}

#[test]
fn a_rising_phase_that_is_seen_late_is_extrapolated_to_its_crossing() {
    let (emf_v, periods) = bench(6000.0);
    let mut state = State::default();
    for _ in 0..2 {
        sextant(&mut state, true, (emf_v, periods, 0.5), 1);
    }
    // The crossing is at 2.78 periods, the first free sample at 4.5.
    let error = sextant(&mut state, true, (emf_v, periods, 0.5), 4);
    let error_deg = error.expect("seen late") / periods * 60.0;
    assert!(error_deg.abs() < 2.0, "{error_deg}");
}

#[test]
fn strictly_a_rising_phase_must_have_been_below() {
    let config = config();
    let bus = Voltage::from_num(BUS_V / BASE_V);
    let mut state = State::default();
    for _ in 0..10 {
        assert_eq!(
            look(
                &config,
                &mut state,
                true,
                true,
                1,
                terminal(1.0),
                (Leg::Low, bus)
            ),
            None
        );
    }
    look(
        &config,
        &mut state,
        true,
        true,
        1,
        terminal(-0.1),
        (Leg::Low, bus),
    );
    assert!(
        look(
            &config,
            &mut state,
            true,
            true,
            1,
            terminal(0.1),
            (Leg::Low, bus)
        )
        .is_some()
    );
}

#[test]
fn a_motor_at_rest_never_crosses() {
    let config = config();
    let bus = Voltage::from_num(BUS_V / BASE_V);
    for rising in [true, false] {
        let mut state = State::default();
        for i in 0..100_000_u32 {
            // Noise of up to three counts.
            let reading = terminal(COUNT_V / 1.5 * f64::from(i * 7 % 11 % 4));
            assert_eq!(
                look(
                    &config,
                    &mut state,
                    rising,
                    true,
                    4,
                    reading,
                    (Leg::Low, bus)
                ),
                None
            );
        }
    }
}

/// The terminal's reading while the switching leg is at the supply.
fn beside_the_supply(emf_v: f64) -> Voltage {
    terminal((BUS_V / 2.0 + 1.5 * emf_v) / 1.5)
}

#[test]
fn at_full_duty_a_crossing_that_was_hidden_is_found_by_the_slope() {
    for sign in [1.0, -1.0] {
        let mut state = State {
            slope: Voltage::from_num(1.5 * 2.0 / BASE_V),
            ..State::default()
        };
        let mut see = |reading| see(&mut state, sign > 0.0, reading, Leg::High);
        // The previous sextant's, then a diode's at either rail; the crossing is a period and a half past.
        for rail_v in [10.0, -100.0, 100.0] {
            assert_eq!(see(terminal(rail_v)), None);
        }
        let age = see(beside_the_supply(sign * 3.0)).expect("past the crossing");
        assert!((age.to_num::<f64>() - 1.5).abs() < 0.02, "{age}");
        assert_eq!(see(beside_the_supply(sign * 5.0)), None, "once");
    }
}

#[test]
fn a_crossing_to_come_is_expected_by_the_slope() {
    let mut state = State {
        slope: Voltage::from_num(1.5 * 2.0 / BASE_V),
        ..State::default()
    };
    assert_eq!(state.expected(), None);
    for reading in [terminal(10.0), beside_the_supply(-4.0)] {
        see(&mut state, true, reading, Leg::High);
    }
    let age = state.expected().expect("seen").to_num::<f64>();
    assert!((age + 2.0).abs() < 0.02, "{age}");
}

#[test]
fn a_sample_between_two_kinds_of_periods_tells_nothing() {
    let mut state = State::default();
    for _ in 0..8 {
        let found = see(&mut state, true, terminal(3.0), Leg::Changes);
        assert_eq!(found, None);
    }
    assert!(state.blind());
}

#[test]
fn a_crossing_is_after_the_last_reading_before_it_whatever_the_slope_was() {
    // A slope from a tenth of the speed.
    let mut state = State {
        slope: Voltage::from_num(0.02 / BASE_V),
        ..State::default()
    };
    let mut see = |emf_v| see(&mut state, true, terminal(emf_v), Leg::Low);
    for emf_v in [10.0, -3.0, -1.0] {
        assert_eq!(see(emf_v), None);
    }
    assert_eq!(see(1.0), Some(I16F16::ONE));
}

#[test]
fn a_terminal_that_stays_at_half_of_the_supply_shows_no_rotor() {
    let slope = Voltage::from_num(1.5 * 2.0 / BASE_V);
    // Before the crossing, at it within a count, and past it by less than counts.
    for (emf_v, expects, shows) in [
        (-4.0, Some(true), true),
        (0.0, None, false),
        (0.02, Some(false), false),
    ] {
        let mut state = State {
            slope,
            ..State::default()
        };
        for reading in [terminal(10.0), beside_the_supply(emf_v)] {
            assert_eq!(see(&mut state, true, reading, Leg::High), None);
        }
        let expected = state.expected().is_some();
        assert!(expects.is_none_or(|expects| expects == expected), "{emf_v}");
        assert_eq!(state.shows_rotor(&config()), shows, "{emf_v}");
    }
}
