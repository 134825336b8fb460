use super::*;
use core::f64::consts::TAU;
use fixed::types::I2F30;
use proptest::prelude::*;

fn config(modulation: Modulation, duty_max: f64) -> Config {
    Config::new(modulation, duty_max as f32, duty_max as f32)
}

/// The vector that the duties produce, without the common mode.
fn vector(duties: [Duty; 3], bus: f64) -> (f64, f64) {
    let [a, b, c] = duties.map(|d| d.to_num::<f64>() * bus);
    ((2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt())
}

proptest! {
    #[test]
    fn no_vector_is_longer_than_the_limit_wherever_the_slope_was_taken(
        bus in 0.2..5.0_f64,
        slope_at in -1.2..1.2_f64,
        d in -3.0..3.0_f64,
        q in -30.0..30_f64,
        turns in 0.0..1_f64,
    ) {
        let config = config(Modulation::SpaceVector, 0.95);
        let length = config.vector_max.to_num::<f64>() * bus;
        let slope_at = Voltage::from_num(slope_at * length);
        let supply = Supply::new(&config, Voltage::from_num(bus), slope_at);
        let asked = Dq {
            d: WideVoltage::from_num(d * length),
            q: WideVoltage::from_num(q * length),
        };
        let (u, _) = limit(asked, &supply.longest);
        let [u_d, u_q] = [u.d, u.q].map(Voltage::to_num::<f64>);
        prop_assert!(u_d.hypot(u_q) < length * 1.001, "{u_d} {u_q} for {length}");
        // No duty wraps: together they produce the vector.
        let (sin, cos) = (turns * TAU).sin_cos();
        let (alpha, beta) = (u_d * cos - u_q * sin, u_d * sin + u_q * cos);
        let v = AlphaBeta {
            alpha: TurnedVoltage::from_num(alpha),
            beta: TurnedVoltage::from_num(beta),
        };
        let made = vector(uncompensated(&config, &supply, v), bus);
        let error = (made.0 - alpha).hypot(made.1 - beta);
        prop_assert!(error < 2e-3 * length.max(1.0), "{error}");
    }
}

#[test]
fn the_duties_make_the_vector_up_to_the_limit() {
    for modulation in [Modulation::SpaceVector, Modulation::Sine(parts::Sine::HERE)] {
        let config = config(modulation, 0.95);
        for bus in [0.2, 0.98, 5.0] {
            let supply = Supply::new(&config, Voltage::from_num(bus), Voltage::ZERO);
            let most = supply.longest.length().to_num::<f64>();
            for degrees in 0..360 {
                let (sin, cos) = (f64::from(degrees) / 360.0 * TAU).sin_cos();
                for length in [0.0, 0.3 * most, 0.999 * most] {
                    let v = AlphaBeta {
                        alpha: TurnedVoltage::from_num(length * cos),
                        beta: TurnedVoltage::from_num(length * sin),
                    };
                    let made = uncompensated(&config, &supply, v);
                    let (alpha, beta) = vector(made, bus);
                    assert!((alpha - length * cos).abs() < 2e-5 * bus.max(1.0));
                    assert!((beta - length * sin).abs() < 2e-5 * bus.max(1.0));
                    assert!(made.iter().all(|d| *d <= Duty::from_num(0.950001)));
                }
            }
        }
    }
}

#[test]
fn space_vector_centres_the_pulses_between_the_limits() {
    let config = config(Modulation::SpaceVector, 0.9);
    let supply = Supply::new(&config, Voltage::ONE, Voltage::ZERO);
    let v = AlphaBeta {
        alpha: TurnedVoltage::from_num(0.4),
        beta: TurnedVoltage::ZERO,
    };
    let [a, b, c] = uncompensated(&config, &supply, v).map(|d| d.to_num::<f64>());
    assert!((a + b - 0.9).abs() < 1e-5 && (b - c).abs() < 1e-6);
}

#[test]
fn a_vector_that_is_too_long_keeps_its_d() {
    let u = Dq {
        d: WideVoltage::from_num(-0.3),
        q: WideVoltage::from_num(20),
    };
    let longest =
        |length: f64| VectorLimit::new(Voltage::from_num(length), Voltage::from_num(-0.29));
    let (limited, cut) = limit(u, &longest(0.5));
    let rest = Dq {
        d: WideVoltage::ZERO,
        q: u.q - wide(limited.q),
    };
    assert_eq!(cut, Some(rest));
    assert_eq!(wide(limited.d), u.d);
    assert!((limited.q.to_num::<f64>() - 0.4).abs() < 1e-4);
    let again = Dq {
        d: wide(limited.d),
        q: wide(limited.q),
    };
    let (passed, cut) = limit(again, &longest(0.501));
    assert_eq!(cut, None);
    assert_eq!((wide(passed.d), wide(passed.q)), (again.d, again.q));
}

#[test]
fn compensation_is_added() {
    let config = config(Modulation::Sine(parts::Sine::HERE), 0.99);
    let supply = Supply::new(&config, Voltage::ONE, Voltage::ZERO);
    let dead_time = dead_time::Config {
        duty: I2F30::from_num(0.01),
        ..dead_time::Config::NONE
    };
    // The signs of a current along phase b minus a, and none in c.
    let certainty = AlphaBeta {
        alpha: I8F24::from_num(20),
        beta: I8F24::from_num(-20.0 / 3.0_f64.sqrt()),
    };
    let v = AlphaBeta::default();
    let phases = Phases::new(&supply, v, PhaseOrder::NORMAL, &dead_time, certainty);
    let made = duties(&config, &phases);
    let [a, b, c] = made.map(|d| d.to_num::<f64>());
    assert!((a - 0.505).abs() < 1e-6, "{a}");
    assert!((b - 0.485).abs() < 1e-6, "{b}");
    assert!((c - 0.495).abs() < 1e-6, "{c}");
}

#[test]
fn the_reciprocal_is_right_to_a_millionth() {
    let config = config(Modulation::SpaceVector, 0.95);
    for i in 26..1600 {
        let bus = Voltage::from_num(f64::from(i) * 0.005);
        let product = Supply::new(&config, bus, Voltage::ZERO)
            .reciprocal
            .to_num::<f64>()
            * bus.to_num::<f64>();
        assert!((product - 1.0).abs() < 1e-6, "{bus}: {product}");
    }
}

#[test]
fn a_vector_is_limited_as_from_a_lower_supply_and_never_a_higher_one() {
    // Here every phase can be read up to 0.9 of the longest vector.
    let config = Config::new(Modulation::SpaceVector, 0.95, 0.9);
    let [low, present, high] = [1, 4, 6].map(Voltage::from_num);
    let mut supply = Supply::new(&config, present, Voltage::ZERO);
    let whole = supply;
    let lower = Supply::new(&config, low, Voltage::ZERO);
    let limits = |supply: &Supply| (supply.longest, supply.readable_square);
    supply.limit_as_from(&config, low);
    assert_eq!(limits(&supply), limits(&lower));
    assert_eq!((supply.bus, supply.reciprocal), (present, whole.reciprocal));
    supply.limit_as_from(&config, high);
    assert_eq!(supply, whole);
}

#[test]
fn no_supply_does_not_divide_by_zero() {
    let config = config(Modulation::SpaceVector, 0.95);
    let supply = Supply::new(&config, Voltage::ZERO, Voltage::ZERO);
    assert_eq!(supply.longest.length(), Voltage::ZERO);
    assert!(supply.reciprocal > InverseVoltage::from_num(7.9));
}
