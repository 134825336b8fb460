//! What the currents of a motor that turns say of sensors, wires and switches.
//!
//! Nothing here ends a drive: a motor that turns on by two phases, or by two sensors, is better than none in the air.
//! It is told, and stays so until the motor rests ([`Limit::warns`]).
//!
//! - **A sensor.** The three currents of a sound motor come to none. Where their sum is on average off by more than half
//!   of what a sound sensor's zero may be off by, a sensor's zero has moved, or it shows nothing any more. A phase that
//!   cannot be read, and so each third phase without a shunt, is made up so that the sum is none: then nothing is known.
//! - **A phase.** Each of a sound motor's phases carries a current in either direction within a turn, and each direction
//!   of it flows through a switch of its own at the least. A phase that never did in one of them, wherever in a turn the
//!   rotor was, and that for some rounds, has an open wire, or a switch that never turns on. That the rotor has been
//!   everywhere is asked for because the currents are looked at in a slow piece of work, whose pace a speed may meet.

use super::config::Config;
use super::seen::{Seen, greatest, reading};
use crate::control::transform::{AlphaBeta, PhaseOrder, phases, rotate_frame};
use crate::math::SinCos;
use crate::protection::{Limit, Limits};
use crate::trace::traced;
use crate::units::{AdcCounts, Angle};

traced! {
    /// What has been seen since the motor rested.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub(super) struct State {
        /// Sum of the last sample's currents.
        sum: AdcCounts,
        /// Mean of its magnitude.
        unbalance: AdcCounts,
        /// For each phase and direction of its current, since that has last flowed: the quarters of a turn in which the
        /// rotor has been, a bit each, and above them the number of times that it has been in all of them.
        idle: [u8; 6],
        /// Looks of the six-step drive.
        sextants: u8,
        /// What is wrong.
        pub(super) found: Limits,
    }
}

/// The four quarters of a turn.
const ALL_QUARTERS: u8 = 0b1111;

/// Rounds of all quarters after which a current that has not flowed never does. A torque that changes its sign would
/// have to do so with the rotor's turns for as long.
const ROUNDS: u8 = 4;

/// Looks over which the sum is smoothed, as a power of two: 40 ms at 24 kHz, or five turns of the six-step drive's sextants.
const LOOKS_LOG2: u32 = 5;

impl State {
    /// Notes a sample's currents.
    #[inline(always)] // in each period
    pub(super) fn note(&mut self, [a, b, c]: [AdcCounts; 3]) {
        self.sum = a.wrapping_add(b).wrapping_add(c);
    }

    /// Smooths the currents' sum. True where it is as it is to be, now and on average.
    fn balance(&mut self, config: &Config) -> bool {
        let off = self.sum.saturating_abs();
        let most = config.sensing.offset_max >> 1;
        self.unbalance += off.wrapping_sub(self.unbalance) >> LOOKS_LOG2;
        if self.unbalance > most {
            self.found.insert(Limit::SensorDrift);
        }
        off <= most && self.unbalance <= most
    }

    /// Each sextant of the six-step drive: looks at the currents at its end. Each direction flows in two of six, and where
    /// one does not, none does in them: four looks stand for the quarters of a turn.
    pub(super) fn look_after_sextant(&mut self, config: &Config, seen: &Seen, order: PhaseOrder) {
        self.sextants = self.sextants.wrapping_add(1);
        let quarter = self.sextants % 4;
        self.look_at(config, seen, order.angle(seen.angle), quarter);
    }

    /// Each cycle of field-oriented control: looks at the currents.
    pub(super) fn look(&mut self, config: &Config, seen: &Seen, order: PhaseOrder) {
        // The frame as the control sees it: the phases are in its order too.
        let theta = order.angle(seen.angle);
        self.look_at(config, seen, theta, (theta.to_bits() as u32 >> 30) as u8);
    }

    #[inline(never)] // only some periods
    fn look_at(&mut self, config: &Config, seen: &Seen, theta: Angle, quarter: u8) {
        if !self.balance(config) {
            self.idle = [0; 6];
            return;
        }
        let stator = rotate_frame(seen.i, SinCos::of(theta.wrapping_neg()));
        let currents = phases(AlphaBeta {
            alpha: stator.d,
            beta: stator.q,
        });
        let most = greatest(currents);
        // What a sensor may be off by is no current.
        if most <= reading(config.sensing.offset_max >> 1) {
            return;
        }
        let (forth, back) = self.idle.split_at_mut(3);
        for ((forth, back), current) in forth.iter_mut().zip(back).zip(currents) {
            pass(forth, current > most >> 3, quarter);
            pass(back, current < -(most >> 3), quarter);
        }
        if self.idle.iter().any(|idle| *idle >> 4 >= ROUNDS) {
            self.found.insert(Limit::PhaseOpen);
        }
    }
}

/// Another look at a direction of a phase's current, in this quarter of a turn.
fn pass(idle: &mut u8, flows: bool, quarter: u8) {
    *idle = match *idle | 1 << quarter {
        _ if flows => 0,
        all if all & ALL_QUARTERS == ALL_QUARTERS => (all & !ALL_QUARTERS).saturating_add(1 << 4),
        some => some,
    };
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::control::transform::{clarke, park};
    use crate::params::{BOSSO_BENCH, Board, Params, build};

    /// Turns of the rotor from look to look: at idle, near a half, and nearly one.
    const STEPS: [f64; 3] = [0.094, 0.49, 0.933];

    /// What is found in so many looks of a rotor that turns so far from one to the next, of currents and readings, in
    /// parts of the greatest offset, at each angle.
    fn found(
        step: f64,
        looks: u32,
        currents: impl Fn(u32, f64) -> [f64; 3],
        shown: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Vec<Limit> {
        let config = build(&Params::of(&BOSSO_BENCH), &Board::BENCH).expect("the bench fits");
        let unit = config.sensing.offset_max.to_num::<f64>();
        let mut state = State::default();
        let mut seen = Seen::NOTHING;
        for look in 0..looks {
            let turns = 0.013 + step * f64::from(look);
            let read = shown(currents(look, turns)).map(|part| AdcCounts::from_num(part * unit));
            state.note(read);
            seen.angle = Angle::wrapping_from_num(turns);
            seen.i = park(clarke(read), SinCos::of(seen.angle));
            state.look(&config, &seen, PhaseOrder::NORMAL);
        }
        state.found.iter().collect()
    }

    /// Phase b's current leads by a third of a turn; negative brakes.
    fn sound(amplitude: f64) -> impl Fn(u32, f64) -> [f64; 3] {
        move |_, turns| [0.0, 1.0, 2.0].map(|third| amplitude * (TAU * (turns - third / 3.0)).cos())
    }

    fn as_is(currents: [f64; 3]) -> [f64; 3] {
        currents
    }

    #[test]
    fn a_sound_motor_is_left_in_peace() {
        for step in STEPS {
            for amplitude in [0.1, 2.0, -2.0] {
                assert_eq!(
                    found(step, 5000, sound(amplitude), as_is),
                    vec![],
                    "{step} {amplitude}"
                );
            }
            // A torque that changes its sign.
            for periods in [2, 7, 40] {
                let pushed = |look: u32, turns: f64| {
                    let along = if (look / periods).is_multiple_of(2) {
                        2.0
                    } else {
                        -2.0
                    };
                    sound(along)(look, turns)
                };
                assert_eq!(found(step, 5000, pushed, as_is), vec![], "{step} {periods}");
            }
        }
    }

    #[test]
    fn a_speed_that_is_that_of_the_looks_is_no_open_phase() {
        for step in [1.0, 0.5, 1.0001, 0.5001] {
            for lag in 0..24 {
                let late = |look, turns: f64| sound(2.0)(look, turns - f64::from(lag) / 24.0);
                assert_eq!(found(step, 5000, late, as_is), vec![], "{step} {lag}");
            }
        }
    }

    #[test]
    fn an_open_wire_and_an_open_switch_are_found_within_a_tenth_of_a_second() {
        let wire = |_, turns: f64| {
            let through = 2.0 * (TAU * turns).cos();
            [through, 0.0, -through]
        };
        let switch = |look, turns| {
            let [a, b, c] = sound(2.0)(look, turns);
            let less = b.max(0.0);
            [a + less / 2.0, b - less, c + less / 2.0]
        };
        for step in STEPS {
            // A look each 1.33 ms at 24 kHz.
            assert_eq!(
                found(step, 150, wire, as_is),
                vec![Limit::PhaseOpen],
                "{step}"
            );
            assert_eq!(
                found(step, 150, switch, as_is),
                vec![Limit::PhaseOpen],
                "{step}"
            );
        }
    }

    #[test]
    fn a_sensor_that_shows_nothing_or_has_moved_is_no_open_phase() {
        for step in STEPS {
            let nothing = |[a, _, c]: [f64; 3]| [a, 0.0, c];
            let moved = |by: f64| move |[a, b, c]: [f64; 3]| [a, b + by, c];
            let drifts = vec![Limit::SensorDrift];
            assert_eq!(found(step, 150, sound(2.0), nothing), drifts, "{step}");
            assert_eq!(found(step, 150, sound(2.0), moved(-1.25)), drifts, "{step}");
            // Without a current too.
            assert_eq!(found(step, 150, sound(0.0), moved(1.25)), drifts, "{step}");
            assert_eq!(found(step, 5000, sound(2.0), moved(0.45)), vec![], "{step}");
        }
    }
}
