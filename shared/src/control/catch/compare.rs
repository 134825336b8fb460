//! Compares a look with its prediction.

use fixed::types::{I2F30, I4F28, I17F15, I19F13};
use siskin_units::math::{SinCos, TopProduct};
use siskin_units::{AdcCounts, Angle, traced};

use crate::control::transform::{AlphaBeta, phases};

/// Highest unambiguous reading of the 12-bit ADC; from here on it may be clamped.
const CLAMP: I17F15 = I17F15::lit("4094");

traced! {
    /// The difference between readings and prediction, as the corrections it calls for.
    #[derive(Clone, Copy, Debug, Default, PartialEq)]
    pub(super) struct Difference {
        /// Sum of the errors, in counts, each times its derivative by the angle, over E.
        pub(super) by_angle: I19F13,
        /// Sum of the squares of these derivatives.
        pub(super) angle_weight: I4F28,
        /// Sum of the errors, in counts, each times its derivative by E.
        pub(super) by_amplitude: I19F13,
        /// Sum of the squares of these derivatives.
        pub(super) amplitude_weight: I4F28,
        /// Sum of the errors' magnitudes.
        pub(super) misfit: I17F15,
    }
}

/// A terminal: what a unit vector predicts for it, and its reading.
#[derive(Clone, Copy)]
struct Terminal {
    /// The phase's component of the unit vector.
    component: I2F30,
    /// That component's derivative by the vector's angle.
    derivative: I2F30,
    reading: I17F15,
}

/// Compares readings with the terminal voltages that a vector of this amplitude at `theta`
/// produces.
pub(super) fn compare(
    diode: AdcCounts,
    theta: Angle,
    amplitude: AdcCounts,
    readings: [I17F15; 3],
) -> Difference {
    let SinCos { cos, sin } = SinCos::of(theta);
    let half = |bits: i32| I2F30::from_bits(bits >> 1);
    let (cos, sin) = (half(cos.to_bits()), half(sin.to_bits()));
    let [a, b, c] = phases(AlphaBeta {
        alpha: cos,
        beta: sin,
    });
    let [da, db, dc] = phases(AlphaBeta {
        alpha: -sin,
        beta: cos,
    });
    let [ra, rb, rc] = readings;
    let terminal = |component, derivative, reading| Terminal {
        component,
        derivative,
        reading,
    };
    let (a, b, c) = (
        terminal(a, da, ra),
        terminal(b, db, rb),
        terminal(c, dc, rc),
    );
    let (lowest, one, other) = if a.component <= b.component && a.component <= c.component {
        (a, b, c)
    } else if b.component <= c.component {
        (b, a, c)
    } else {
        (c, a, b)
    };
    // 16 + 30 − 32 fraction bits.
    let counts = |component: I2F30| I17F15::from_bits(amplitude.top(component).to_bits() << 1);
    // The readings sit on the lowest phase's diode drop, if that diode conducts.
    let lift = counts(-lowest.component) - I17F15::from_bits(diode.to_bits() >> 1);
    let (lift, base_component, base_derivative) = if lift > I17F15::ZERO {
        (lift, lowest.component, lowest.derivative)
    } else {
        (I17F15::ZERO, I2F30::ZERO, I2F30::ZERO)
    };
    let half_amplitude = I17F15::from_bits(amplitude.to_bits() >> 2);
    // The lowest phase is predicted at its clamp.
    let mut sum = Difference {
        misfit: lowest.reading,
        ..Difference::default()
    };
    let mut add = |terminal: Terminal| {
        let reading = terminal.reading;
        let predicted = counts(terminal.component) + lift;
        if predicted >= CLAMP && reading >= CLAMP {
            return;
        }
        let error = reading - predicted.max(I17F15::ZERO).min(CLAMP);
        sum.misfit += error.abs();
        // Slightly above zero where nothing is predicted is noise; half the amplitude is not.
        if predicted > I17F15::ZERO || reading >= half_amplitude {
            // At most √3.
            let by_amplitude = terminal.component - base_component;
            let by_angle = terminal.derivative - base_derivative;
            sum.by_angle += by_angle.top(error);
            sum.by_amplitude += by_amplitude.top(error);
            sum.angle_weight += by_angle.top(by_angle);
            sum.amplitude_weight += by_amplitude.top(by_amplitude);
        }
    };
    add(one);
    add(other);
    sum
}
