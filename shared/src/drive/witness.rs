//! What the currents of a motor that turns say of sensors, wires and switches, as snapshots show it. The tasks work this
//! out, not the interrupt.
//!
//! Nothing here ends a drive: a motor that turns on by two phases, or by two sensors, is better than none in the air.
//! It is told, and stays so until the motor rests ([`Limit::warns`]).
//!
//! - **A sensor.** The three currents of a sound motor come to none. Where their sum is off by more than half of what a
//!   sound sensor's zero is, always or with the turns, a sensor's zero has moved, or it shows nothing any more.
//!   Noise is neither. A phase that cannot be read, and so each third phase without a shunt, is made up so that the sum is
//!   none: then nothing is known.
//! - **A phase.** Each of a sound motor's phases carries a current in either direction within a turn, and each direction
//!   of it flows through a switch of its own at the least. A phase that never did in one of them, wherever in a turn the
//!   rotor was, and that for some rounds, has an open wire, or a switch that never turns on. That the rotor has been
//!   everywhere is asked for because a speed may meet the pace of the looks.

use super::snapshot::Snapshot;
use crate::protection::{Limit, Limits};
use crate::units::{AdcCounts, Angle};

/// What has been seen since the motor rested.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Witness {
    /// Means of the currents' sum: as it is, and with the signs of the angle's sine and cosine.
    sums: [AdcCounts; 3],
    rounds: Rounds,
    /// What is wrong.
    found: Limits,
}

/// Directions of the three phases' currents, a bit each: forth, and then back.
type Directions = u8;

const ALL_DIRECTIONS: Directions = 0b11_1111;
const FORTH: Directions = 0b00_0111;

/// The last rounds, in each of which the rotor has been in every sixth of a turn.
///
/// Where its speed meets the pace of the looks these are of two places half a turn apart, or about one: between two such
/// places a phase may be that carries none there. They do not come to six sixths, and those of three and more places show
/// each phase's currents.
#[derive(Clone, Debug, Default, PartialEq)]
struct Rounds {
    /// How many they are.
    count: u8,
    /// Directions that a current has had in any of them, or in the present one.
    flowed: Directions,
    /// Of the present one: the sixths, a bit each.
    sixths: u8,
    /// Of the present one: the greatest current.
    greatest: AdcCounts,
}

const ALL_SIXTHS: u8 = 0b11_1111;

/// A quarter of a turn.
const QUARTER: Angle = Angle::from_bits(1 << 30);

/// Rounds after which a current that has not flowed never does. A torque that swings would have to do so with the rotor's
/// turns, as the looks see them, for as long: with half as many, one of 240 slams of sound motors does.
const ROUNDS: u8 = 16;

/// Looks over which the sum is smoothed, as a power of two: 32 ms.
const LOOKS_LOG2: u32 = 5;

impl Witness {
    /// Looks at a snapshot, about each millisecond; `most` is what the currents' sum may be off by. Returns what is
    /// wrong.
    // In its own registers: the caller has none left.
    #[inline(never)]
    pub fn look(&mut self, snapshot: &Snapshot, most: AdcCounts) -> Limits {
        if !snapshot.phase.drives() {
            *self = Self::default();
        } else if snapshot.missed_sextants > 0 || !self.is_balanced(snapshot, most) {
            self.rounds = Rounds::default();
        } else if self.rounds.look(&snapshot.currents, snapshot.angle, most) {
            self.found.insert(Limit::PhaseOpen);
        }
        if snapshot.sensor_fault {
            self.found.insert(Limit::PositionSensor);
        }
        self.found
    }

    /// Smooths the currents' sum. True where it is as it is to be, now and on average.
    fn is_balanced(&mut self, snapshot: &Snapshot, most: AdcCounts) -> bool {
        let [a, b, c] = snapshot.currents;
        let now = a.wrapping_add(b).wrapping_add(c);
        let signed = |angle: Angle| {
            if angle.is_negative() {
                now.wrapping_neg()
            } else {
                now
            }
        };
        let [constant, sine, cosine] = &mut self.sums;
        let with_turns = smooth(sine, signed(snapshot.angle))
            .wrapping_add(smooth(cosine, signed(snapshot.angle.wrapping_add(QUARTER))));
        let off = smooth(constant, now).max(with_turns);
        if off > most {
            self.found.insert(Limit::SensorDrift);
        }
        off.max(now.wrapping_abs()) <= most
    }
}

/// Another look at something. Returns the magnitude of its mean.
fn smooth(mean: &mut AdcCounts, now: AdcCounts) -> AdcCounts {
    *mean += now.wrapping_sub(*mean) >> LOOKS_LOG2;
    mean.wrapping_abs()
}

impl Rounds {
    /// Takes in currents at an angle of the rotor; up to `none` there is none. True where for so many rounds one has not
    /// flowed in a direction of its.
    fn look(&mut self, currents: &[AdcCounts; 3], angle: Angle, none: AdcCounts) -> bool {
        let mut phase: Directions = 0b00_1001;
        for current in currents {
            let magnitude = current.wrapping_abs();
            self.greatest = self.greatest.max(magnitude);
            // Of a current that is cut off nothing is left but noise.
            let most: AdcCounts = self.greatest >> 1;
            if magnitude > most.max(none) >> 3 {
                self.flowed |= phase & if current.is_negative() { !FORTH } else { FORTH };
            }
            phase <<= 1;
        }
        // The top of the product with six counts them.
        self.sixths |= 1 << ((u64::from(angle.to_bits() as u32) * 6) >> 32) as u32;
        if self.sixths != ALL_SIXTHS {
            return false;
        }
        self.sixths = 0;
        self.count = self.count.saturating_add(1);
        // A round without any current tells nothing, nor do those before it.
        if core::mem::take(&mut self.greatest) <= none || self.flowed == ALL_DIRECTIONS {
            *self = Self::default();
        }
        self.count >= ROUNDS
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;
    use std::vec;
    use std::vec::Vec;

    use super::*;
    use crate::drive::{Phase, State};
    use crate::params::{BOSSO_BENCH, Board, Params, build};

    /// Turns of the rotor from look to look: at idle, near a half, and nearly one.
    const STEPS: [f64; 3] = [0.094, 0.49, 0.933];

    const MOST: AdcCounts = AdcCounts::lit("100");

    /// What is found in so many looks of a rotor that turns so far from one to the next, of currents and readings, in
    /// parts of what a sensor may be off by, at each angle.
    fn found(
        step: f64,
        looks: u32,
        currents: impl Fn(u32, f64) -> [f64; 3],
        shown: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Vec<Limit> {
        let turns = |look| 0.013 + step * f64::from(look);
        found_at(turns, looks, currents, shown)
    }

    /// The same of a rotor that is so many turns on at each look.
    fn found_at(
        turns: impl Fn(u32) -> f64,
        looks: u32,
        currents: impl Fn(u32, f64) -> [f64; 3],
        shown: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Vec<Limit> {
        let mut witness = Witness::default();
        let mut snapshot = snapshot();
        for look in 0..looks {
            let turns = turns(look);
            let read = shown(currents(look, turns));
            snapshot.currents = read.map(|part| MOST * AdcCounts::from_num(part));
            snapshot.angle = Angle::wrapping_from_num(turns);
            witness.look(&snapshot, MOST);
        }
        witness.found.iter().collect()
    }

    /// Of a motor that runs.
    fn snapshot() -> Snapshot {
        let config = build(&Params::of(&BOSSO_BENCH), &Board::BENCH).expect("the bench fits");
        Snapshot {
            phase: Phase::Run,
            ..State::new(&config).snapshot()
        }
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
            for amplitude in [0.2, 4.0, -4.0] {
                assert_eq!(
                    found(step, 5000, sound(amplitude), as_is),
                    vec![],
                    "{step} {amplitude}"
                );
            }
            // A torque that changes its sign.
            for looks in [2, 7, 40] {
                let pushed = |look: u32, turns: f64| {
                    let along = if (look / looks).is_multiple_of(2) {
                        4.0
                    } else {
                        -4.0
                    };
                    sound(along)(look, turns)
                };
                assert_eq!(found(step, 5000, pushed, as_is), vec![], "{step} {looks}");
            }
        }
    }

    #[test]
    fn a_speed_that_is_that_of_the_looks_is_no_open_phase() {
        for step in [1.0, 0.5, 1.0 / 3.0, 0.25, 0.2, 1.0001, 0.5001] {
            for lag in 0..24 {
                let late = |look, turns: f64| sound(4.0)(look, turns - f64::from(lag) / 24.0);
                // It is held to a degree.
                for swing in [0.0, 0.003] {
                    for begin in 0..24 {
                        let at = |look| {
                            let swung = swing * f64::from(look).sin();
                            f64::from(begin) / 24.0 + step * f64::from(look) + swung
                        };
                        let found = found_at(at, 1000, late, as_is);
                        assert_eq!(found, vec![], "{step} {lag} {swing} {begin}");
                    }
                }
            }
        }
    }

    #[test]
    fn noise_is_no_drift() {
        // Of 3 % of a board's range, rms, where that is 30 parts of 50; drawn by a linear congruence.
        let mut draw = 1_u32;
        let mut noise = move || {
            draw = draw.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(draw >> 8) / f64::from(1 << 23) - 1.0
        };
        let rms = 0.6 * 3.0_f64.sqrt();
        let noise: Vec<[f64; 3]> = (0..5000).map(|_| [(); 3].map(|()| rms * noise())).collect();
        for step in STEPS {
            for amplitude in [0.0, 4.0] {
                let noisy = |look: u32, turns| {
                    let (current, noise) = (sound(amplitude)(look, turns), noise[look as usize]);
                    [0, 1, 2].map(|phase| current[phase] + noise[phase])
                };
                assert_eq!(
                    found(step, 5000, noisy, as_is),
                    vec![],
                    "{step} {amplitude}"
                );
            }
        }
    }

    #[test]
    fn an_open_wire_and_an_open_switch_are_found_within_six_tenths_of_a_second() {
        let wire = |_, turns: f64| {
            let through = 4.0 * (TAU * turns).cos();
            [through, 0.0, -through]
        };
        let switch = |look, turns| {
            let [a, b, c] = sound(4.0)(look, turns);
            let less = b.max(0.0);
            [a + less / 2.0, b - less, c + less / 2.0]
        };
        for step in STEPS {
            let open = vec![Limit::PhaseOpen];
            assert_eq!(found(step, 600, wire, as_is), open, "{step}");
            assert_eq!(found(step, 600, switch, as_is), open, "{step}");
        }
    }

    #[test]
    fn a_sensor_that_shows_nothing_or_has_moved_is_no_open_phase() {
        for step in STEPS {
            let nothing = |[a, _, c]: [f64; 3]| [a, 0.0, c];
            let moved = |by: f64| move |[a, b, c]: [f64; 3]| [a, b + by, c];
            let drifts = vec![Limit::SensorDrift];
            assert_eq!(found(step, 200, sound(4.0), nothing), drifts, "{step}");
            assert_eq!(found(step, 200, sound(4.0), moved(-2.5)), drifts, "{step}");
            // Without a current too.
            assert_eq!(found(step, 200, sound(0.0), moved(2.5)), drifts, "{step}");
            assert_eq!(found(step, 5000, sound(4.0), moved(0.9)), vec![], "{step}");
        }
    }

    #[test]
    fn what_was_wrong_is_forgotten_at_rest_but_a_position_sensor_that_still_is() {
        let mut witness = Witness::default();
        let mut snapshot = Snapshot {
            sensor_fault: true,
            currents: [MOST * AdcCounts::lit("3"); 3],
            ..snapshot()
        };
        for _ in 0..200 {
            witness.look(&snapshot, MOST);
        }
        let all = [Limit::SensorDrift, Limit::PositionSensor];
        assert!(witness.look(&snapshot, MOST).iter().eq(all));
        snapshot.phase = Phase::Brake;
        let still = [Limit::PositionSensor];
        assert!(witness.look(&snapshot, MOST).iter().eq(still));
        snapshot.sensor_fault = false;
        assert!(witness.look(&snapshot, MOST).is_empty());
    }
}
