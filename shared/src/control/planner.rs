//! Trajectory planner: from a speed command Ω* to ω* and its derivative.
//!
//! The reference follows a step in the command at full slew, and over the last slew/λ
//! exponentially: with this soft landing the drive does not overshoot even with a wrong inertia. It
//! follows a command that moves within the slew without lag. The slew builds up over some
//! milliseconds, so its torque is no step for the current loop.

use siskin_units::math::{Gain, Held};
use siskin_units::{Speed, traced};

/// Limits of the trajectory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Largest change of ω* per period.
    pub slew: Speed,
    /// Largest change of that change from period to period.
    pub jerk: Speed,
    /// λ·T_s, the share of the remainder that a period covers at the end; 1 lands at full slew.
    pub approach: Gain<Speed, Speed>,
}

traced! {
    /// The trajectory's state.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// ω*.
        pub reference: Speed,
        /// Ω* of the previous period.
        command: Speed,
        /// The last step of ω*.
        step: Speed,
    }
}

impl State {
    /// Starts a trajectory at this speed.
    pub fn begin(reference: Speed) -> Self {
        Self {
            reference,
            command: reference,
            step: Speed::ZERO,
        }
    }

    /// Returns the step that ω* may take this period, ω̇*·T_s. The drive reports the step it takes
    /// to [`State::advance`].
    #[inline(always)] // in the longest period
    pub fn plan(&mut self, config: &Config, command: Speed) -> Speed {
        let moved = command.minus(self.command);
        let left = self.command.minus(self.reference);
        self.command = command;
        // Rounded away from zero, so that the reference reaches the command.
        let share = if left.is_negative() {
            config.approach.apply(left).max(left)
        } else {
            (-config.approach.apply(-left)).min(left)
        };
        moved
            .plus(share)
            .min(config.slew)
            .max(-config.slew)
            .min(self.step.plus(config.jerk))
            .max(self.step.minus(config.jerk))
    }

    /// Advances ω* by a step.
    #[inline(always)] // in the longest period
    pub fn advance(&mut self, step: Speed) {
        self.reference = self.reference.plus(step);
        self.step = step;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn config(approach: f32) -> Config {
        Config {
            slew: Speed::from_num(0.001),
            jerk: Speed::from_num(0.002),
            approach: Gain::new(approach).expect("in range"),
        }
    }

    /// Steps towards a command until none is left; returns the steps.
    fn run(config: &Config, state: &mut State, command: Speed) -> std::vec::Vec<Speed> {
        let mut steps = std::vec::Vec::new();
        loop {
            let step = state.plan(config, command);
            if step == Speed::ZERO {
                return steps;
            }
            state.advance(step);
            steps.push(step);
        }
    }

    #[test]
    fn the_slew_is_kept_both_ways_and_the_command_is_reached() {
        let config = config(1.0);
        let mut state = State::default();
        let command = Speed::from_num(0.0105);
        let steps = run(&config, &mut state, command);
        assert_eq!(steps.len(), 11);
        assert!(steps[..10].iter().all(|step| *step == config.slew));
        assert_eq!(state.reference, command);
        assert_eq!(state.plan(&config, Speed::ZERO), -config.slew);
    }

    #[test]
    fn a_jump_lands_exponentially_and_does_not_pass_the_command() {
        let config = config(0.1);
        for command in [0.03, -0.03].map(Speed::from_num) {
            let mut state = State::default();
            let steps = run(&config, &mut state, command);
            assert_eq!(state.reference, command);
            // Full slew until slew/λ is left: 0.01 of 0.03, 20 periods plus the one it starts in.
            let full = steps.iter().filter(|s| s.abs() == config.slew).count();
            assert!((20..=21).contains(&full), "{full}");
            let at_end = steps[full + 1].abs() < config.slew * 9 / 10;
            assert!(at_end, "{:?}", steps[full + 1]);
        }
    }

    #[test]
    fn a_command_that_moves_within_the_slew_is_followed_at_once() {
        let config = config(0.01);
        let mut state = State::begin(Speed::from_num(0.05));
        for period in 0..500 {
            let turn = f64::from(period) / 500.0 * core::f64::consts::TAU;
            let command = Speed::from_num(0.05 + 0.05 * turn.sin());
            let step = state.plan(&config, command);
            state.advance(step);
            assert!((state.reference - command).abs() < Speed::from_num(1e-6));
        }
    }
}
