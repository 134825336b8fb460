//! Speed regulators: from a speed command to the reference current (`CTL_SPEED`).

pub mod feed_forward;
mod input;
pub mod nested;

use siskin_params::parts;
use siskin_units::{Current, Speed, stated_torque, traced};

use super::planner;
use super::regulator::Reference;
pub use input::{Bounds, Input};

/// The planner and one of the laws.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// From the command to ω*.
    pub planner: planner::Config,
    /// From ω* to the current.
    pub law: Law,
}

/// A regulator and its coefficients.
#[derive(Clone, Debug, PartialEq)]
pub enum Law {
    /// First paper, (8) and (9).
    Nested(nested::Config),
    /// Second paper, figure 47.
    FeedForward(feed_forward::Config, parts::Propeller),
}

impl Default for Law {
    fn default() -> Self {
        Self::Nested(nested::Config::default())
    }
}

traced! {
    /// The trajectory, and the integrators of both laws.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        planner: planner::State,
        nested: nested::State,
        feed_forward: feed_forward::State,
    }
}

impl Config {
    /// Runs one outer-loop period: moves ω* towards the command and returns the current that takes the speed to
    /// ω*.
    pub fn current(&self, state: &mut State, input: &Input) -> Reference {
        let step = state.planner.plan(&self.planner, input.command);
        match &self.law {
            Law::Nested(c) => c.current(
                &mut state.nested,
                &mut state.planner,
                (step, self.planner.slew),
                input,
            ),
            Law::FeedForward(c, _) => {
                state.planner.advance(step);
                let reference = state.planner.reference;
                c.current(&mut state.feed_forward, reference, input)
            }
        }
    }

    /// Starts or resumes at this speed with this current, bumplessly.
    pub fn preset(&self, state: &mut State, speed: Speed, i_q: Current) {
        state.planner = planner::State::begin(speed);
        match &self.law {
            Law::Nested(_) => state.nested.sigma = stated_torque(i_q),
            Law::FeedForward(c, _) => state.feed_forward.sigma = c.remainder(speed, i_q),
        }
    }
}

impl State {
    /// ω*.
    pub fn reference(&self) -> Speed {
        self.planner.reference
    }
}
