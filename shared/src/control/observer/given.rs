//! No observer: an encoder, or a simulation that knows the truth, supplies the rotor's position.

use siskin_units::math::{Held, SinCos};
use siskin_units::{Angle, Speed, traced};

use super::{Estimate, SlowEstimate};

traced! {
    /// Angle and speed given for the next sample, with the phases in the order a, b, c.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// Electrical angle.
        pub theta: Angle,
        /// Electrical speed.
        pub omega: Speed,
        /// Change of the speed since the previous report.
        pub omega_step: Speed,
    }
}

impl State {
    /// Sets the rotor's angle and speed at the next sample.
    pub fn place(&mut self, theta: Angle, omega: Speed) {
        self.theta = theta;
        self.omega_step = omega.minus(self.omega);
        self.omega = omega;
    }

    /// Returns angle and speed as the control sees them: with phases b and c `swapped` it turns the
    /// other way.
    pub fn seen(&self, swapped: bool) -> (Angle, Speed) {
        if swapped {
            (self.theta.wrapping_neg(), self.omega.saturating_neg())
        } else {
            (self.theta, self.omega)
        }
    }
}

/// Returns the reported position as this period's estimate.
pub fn estimate(state: &State, swapped: bool) -> (Estimate, SlowEstimate) {
    let (theta, omega) = state.seen(swapped);
    let estimate = Estimate {
        theta,
        frame: SinCos::of(theta),
        omega,
        omega_bar: omega,
    };
    let slow = SlowEstimate {
        omega_bar_step: if swapped {
            state.omega_step.saturating_neg()
        } else {
            state.omega_step
        },
        ..SlowEstimate::default()
    };
    (estimate, slow)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_is_seen_and_turned_where_the_phases_are() {
        let mut state = State::default();
        state.place(Angle::lit("0.2"), Speed::lit("0.01"));
        state.place(Angle::lit("0.25"), Speed::lit("0.03"));
        let (seen, slow) = estimate(&state, false);
        assert_eq!(
            (seen.theta, seen.omega),
            (Angle::lit("0.25"), Speed::lit("0.03"))
        );
        assert_eq!(slow.omega_bar_step, Speed::lit("0.03") - Speed::lit("0.01"));
        let (turned, turned_slow) = estimate(&state, true);
        assert_eq!(
            (turned.theta, turned.omega_bar),
            (-Angle::lit("0.25"), -Speed::lit("0.03"))
        );
        assert_eq!(turned_slow.omega_bar_step, -slow.omega_bar_step);
    }
}
