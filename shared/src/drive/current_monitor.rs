//! Warnings of a broken current sensor, wire or switch, drawn from the currents of a turning motor.
//!
//! This works on snapshots, in the tasks; the interrupt only keeps the three readings. Nothing here stops the motor: in
//! the air, one that limps on two phases or two sensors beats none. A warning stays until the motor rests.
//!
//! - **Current sensor.** The three phase currents of a sound motor sum to zero. If the mean of the sum, or its component
//!   that turns with the rotor, exceeds half of the zero error that a sound sensor may have, a sensor has drifted or
//!   reads nothing. Noise of up to 3 % of the range averages out. A phase that cannot be read, such as one without a
//!   shunt, is reconstructed from the other two: the sum is then zero by construction, and tells nothing.
//! - **Phase.** Within an electrical turn each phase of a sound motor conducts in both directions, and each direction
//!   passes through at least one switch of its own. A direction that has not conducted in several turns, wherever the
//!   rotor was, means an open wire or a switch that does not turn on.

use siskin_units::math::Held;
use siskin_units::{AdcCounts, Angle, Current, QUARTER_TURN};

use super::snapshot::Snapshot;
use crate::protection::{Limit, Limits};

/// What the currents have shown since the motor rested.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CurrentMonitor {
    /// Means of the currents' sum: as it is, and with the signs of the angle's sine and cosine.
    sums: [AdcCounts; 3],
    rounds: Rounds,
    warnings: Limits,
}

/// Directions of the phases' currents, a bit each: into a, b and c, then out of them.
type Directions = u32;

const ALL_DIRECTIONS: Directions = 0b11_1111;

/// Rounds since all directions were last seen to conduct.
#[derive(Clone, Debug, Default, PartialEq)]
struct Rounds {
    /// Rounds in which the regulator failed to make the current.
    suspect: u32,
    /// Directions that have conducted in any round.
    conducted: Directions,
    round: Round,
}

/// Covers one turn or a few, until the rotor has been seen in five sextants.
///
/// At a speed in step with the samples, these see the same few places of each turn. Two places half a turn apart may
/// miss a sound phase's current altogether, and count as four sextants as the speed wavers. Five places, 72 degrees
/// apart, show at least 0.8 of each direction's peak. At four places a turn an open phase goes unseen.
#[derive(Clone, Debug, Default, PartialEq)]
struct Round {
    /// Sextants in which the rotor has been, a bit each.
    sextants: u32,
    /// The greatest current of each direction.
    peaks: [AdcCounts; 6],
    /// The greatest current along q, and the greatest error of it.
    i_q: Current,
    error: Current,
}

const ALL_SEXTANTS: u32 = 0b11_1111;

/// Suspect rounds after which a direction that has not conducted is open.
const OPEN_ROUNDS: u32 = 8;

/// Time constant of the sum's means, in samples, as a power of two: 32 ms.
const MEAN_SAMPLES_LOG2: u32 = 5;

impl CurrentMonitor {
    /// Takes in a snapshot, about once a millisecond, and returns the warnings.
    ///
    /// `unbalance_max` is what the currents of sound sensors may sum to on average.
    // In its own registers: the caller has none left.
    #[inline(never)]
    pub fn update(&mut self, snapshot: &Snapshot, unbalance_max: AdcCounts) -> Limits {
        if !snapshot.phase.drives() {
            *self = Self::default();
        } else if snapshot.missed_sextants > 0 || !self.is_balanced(snapshot, unbalance_max) {
            self.rounds = Rounds::default();
        } else if self.rounds.update(snapshot, unbalance_max) {
            self.warnings.insert(Limit::PhaseOpen);
        }
        if snapshot.sensor_fault {
            self.warnings.insert(Limit::PositionSensor);
        }
        self.warnings
    }

    /// Averages the sum of the currents. Returns true if it is within bounds, now and on average.
    fn is_balanced(&mut self, snapshot: &Snapshot, unbalance_max: AdcCounts) -> bool {
        let [a, b, c] = snapshot.currents;
        let sum = a.wrapping_add(b).wrapping_add(c);
        let signed = |angle: Angle| {
            if angle.is_negative() {
                sum.wrapping_neg()
            } else {
                sum
            }
        };
        let [constant, sine, cosine] = &mut self.sums;
        let turning = average(sine, signed(snapshot.angle)).wrapping_add(average(
            cosine,
            signed(snapshot.angle.wrapping_add(QUARTER_TURN)),
        ));
        let unbalance = average(constant, sum).max(turning);
        if unbalance > unbalance_max {
            self.warnings.insert(Limit::SensorDrift);
        }
        unbalance.max(sum.wrapping_abs()) <= unbalance_max
    }
}

/// Takes a value into a mean, and returns the mean's magnitude.
fn average(mean: &mut AdcCounts, value: AdcCounts) -> AdcCounts {
    *mean += value.wrapping_sub(*mean) >> MEAN_SAMPLES_LOG2;
    mean.wrapping_abs()
}

impl Rounds {
    /// Takes in the currents; one of up to `none` may be no current. Returns true if a direction is open.
    fn update(&mut self, snapshot: &Snapshot, none: AdcCounts) -> bool {
        let round = &mut self.round;
        if !round.update(snapshot) {
            return false;
        }
        let greatest = round
            .peaks
            .iter()
            .fold(AdcCounts::ZERO, |most, peak| most.max(*peak));
        // A direction that does not conduct still shows noise.
        let noise = greatest >> 3;
        let mut direction: Directions = 1;
        for peak in &round.peaks {
            if *peak > noise {
                self.conducted |= direction;
            }
            direction <<= 1;
        }
        // A torque that swings in step with the turns asks a sound phase for current in one direction only, and gets it.
        // An open phase leaves an error.
        if round.error > round.i_q >> 2 {
            self.suspect += 1;
        }
        *round = Round::default();
        // Without any current the rotor may have gone anywhere.
        if self.conducted == ALL_DIRECTIONS || greatest <= none {
            *self = Self::default();
        }
        self.suspect >= OPEN_ROUNDS
    }
}

impl Round {
    /// Takes in the currents. Returns true if this completes the round.
    fn update(&mut self, snapshot: &Snapshot) -> bool {
        for (phase, current) in snapshot.currents.iter().enumerate() {
            let [forth, back] = [phase, phase + 3];
            self.peaks[forth] = self.peaks[forth].max(*current);
            self.peaks[back] = self.peaks[back].max(current.wrapping_neg());
        }
        let error = snapshot.i.q.minus(snapshot.i_q_reference);
        self.i_q = self.i_q.max(snapshot.i.q.abs());
        self.error = self.error.max(error.abs());
        // The top of the product with six counts the sextants.
        self.sextants |= 1 << ((u64::from(snapshot.angle.to_bits() as u32) * 6) >> 32) as u32;
        let missing = ALL_SEXTANTS ^ self.sextants;
        missing & missing.wrapping_sub(1) == 0
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;
    use std::vec;
    use std::vec::Vec;

    use siskin_params::{BOSSO_BENCH, Board, Params};

    use super::*;
    use crate::build::build;
    use crate::drive::{Phase, State};

    /// Turns of the rotor from sample to sample: at idle, at 1200 turns a second, near a half, and nearly one.
    const STEPS: [f64; 4] = [0.094, 0.2, 0.49, 0.933];

    const MOST: AdcCounts = AdcCounts::lit("100");

    /// The warnings after so many samples of a rotor that turns so far from one to the next. Currents and their
    /// readings are in parts of `MOST`.
    fn found(
        step: f64,
        samples: u32,
        currents: impl Fn(u32, f64) -> [f64; 3],
        shown: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Vec<Limit> {
        let turns = |sample| 0.013 + step * f64::from(sample);
        found_at(turns, samples, currents, shown, None)
    }

    /// The same with the rotor at so many turns at each sample, and with the current along q that is asked for: without
    /// it the one that flows.
    fn found_at(
        turns: impl Fn(u32) -> f64,
        samples: u32,
        currents: impl Fn(u32, f64) -> [f64; 3],
        shown: impl Fn([f64; 3]) -> [f64; 3],
        asked: Option<f64>,
    ) -> Vec<Limit> {
        let mut monitor = CurrentMonitor::default();
        let mut snapshot = snapshot();
        for sample in 0..samples {
            let turns = turns(sample);
            let currents = currents(sample, turns);
            let along_q: f64 = currents.iter().zip(unit(turns)).map(|(i, q)| i * q).sum();
            let i_q = 2.0 / 3.0 * along_q;
            snapshot.currents = shown(currents).map(|part| MOST * AdcCounts::from_num(part));
            snapshot.i.q = Current::from_num(i_q / 16.0);
            snapshot.i_q_reference = Current::from_num(asked.unwrap_or(i_q) / 16.0);
            snapshot.angle = Angle::wrapping_from_num(turns);
            monitor.update(&snapshot, MOST);
        }
        monitor.warnings.iter().collect()
    }

    /// Of a motor that runs.
    fn snapshot() -> Snapshot {
        let config = build(&Params::of(&BOSSO_BENCH), &Board::BENCH).expect("the bench fits");
        Snapshot {
            phase: Phase::Run,
            ..State::new(&config).snapshot()
        }
    }

    /// Currents of unit torque.
    fn unit(turns: f64) -> [f64; 3] {
        [0.0, 1.0, 2.0].map(|third| (TAU * (turns - third / 3.0)).cos())
    }

    /// A negative amplitude brakes.
    fn sound(amplitude: f64) -> impl Fn(u32, f64) -> [f64; 3] {
        move |_, turns| unit(turns).map(|current| amplitude * current)
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
            for samples in [2, 7, 40] {
                let pushed = |sample: u32, turns: f64| {
                    let along = if (sample / samples).is_multiple_of(2) {
                        4.0
                    } else {
                        -4.0
                    };
                    sound(along)(sample, turns)
                };
                assert_eq!(found(step, 5000, pushed, as_is), vec![], "{step} {samples}");
            }
        }
    }

    #[test]
    fn a_speed_in_step_with_the_samples_is_no_open_phase() {
        for step in [1.0, 0.5, 1.0 / 3.0, 0.25, 0.2, 1.0001, 0.5001] {
            for lag in 0..24 {
                let late = |sample, turns: f64| sound(4.0)(sample, turns - f64::from(lag) / 24.0);
                // It is held to a degree.
                for swing in [0.0, 0.003] {
                    for begin in 0..24 {
                        let at = |sample| {
                            let swung = swing * f64::from(sample).sin();
                            f64::from(begin) / 24.0 + step * f64::from(sample) + swung
                        };
                        let found = found_at(at, 1000, late, as_is, None);
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
                let noisy = |sample: u32, turns| {
                    let (current, noise) =
                        (sound(amplitude)(sample, turns), noise[sample as usize]);
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
        let switch = |sample, turns| {
            let [a, b, c] = sound(4.0)(sample, turns);
            let less = b.max(0.0);
            [a + less / 2.0, b - less, c + less / 2.0]
        };
        for step in STEPS {
            let open = vec![Limit::PhaseOpen];
            let turns = |sample| 0.013 + step * f64::from(sample);
            let asked = Some(4.0);
            assert_eq!(found_at(turns, 600, wire, as_is, asked), open, "{step}");
            assert_eq!(found_at(turns, 600, switch, as_is, asked), open, "{step}");
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
        let mut monitor = CurrentMonitor::default();
        let mut snapshot = Snapshot {
            sensor_fault: true,
            currents: [MOST * AdcCounts::lit("3"); 3],
            ..snapshot()
        };
        for _ in 0..200 {
            monitor.update(&snapshot, MOST);
        }
        let all = [Limit::SensorDrift, Limit::PositionSensor];
        assert!(monitor.update(&snapshot, MOST).iter().eq(all));
        snapshot.phase = Phase::Brake;
        let still = [Limit::PositionSensor];
        assert!(monitor.update(&snapshot, MOST).iter().eq(still));
        snapshot.sensor_fault = false;
        assert!(monitor.update(&snapshot, MOST).is_empty());
    }
}
