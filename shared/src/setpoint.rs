//! Maps what is granted to the drive's set-point.

use siskin_params::choice::CtlMode;
use siskin_params::{FromMotor, ParamId, Params};
use siskin_throttle::authority::{Command, Demanded, Granted};
use siskin_throttle::{Share, reverse};
use siskin_units::math::{Held, Real, TopProduct};
use siskin_units::{Current, Scale, Speed};

use crate::build::test_current;
use crate::drive::Setpoint;
use crate::drive::config::tone;
use crate::tune::Note;

/// What the tasks may use the motor's phases for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Use {
    /// A note of a tune.
    Note(Note),
    /// A set-point of a self-test or an identification.
    Measure(Setpoint),
}

/// How throttle maps to a set-point (`CTL_MODE`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mapping {
    mode: Mode,
    period_s: f32,
    test_full: Current,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    /// Linear from minimum to maximum speed.
    Speed { least: Speed, span: Speed },
    /// Linear from zero current to the limit.
    Torque { full: Current },
    /// Linear from zero voltage to full modulation.
    Voltage,
}

impl Mapping {
    /// Creates the mapping from the parameters.
    pub fn new(params: &Params, scale: &Scale) -> Self {
        let params = &params.in_force();
        let full = scale.current_from_a(params.get(ParamId::LimPhaseA));
        let least = scale.speed_from_rpm(FromMotor::new(params).least_rpm);
        let fastest = scale.speed_from_rpm(params.get(ParamId::CtlRpmMax));
        Self {
            mode: match params.choice() {
                CtlMode::Speed => Mode::Speed {
                    least,
                    span: fastest.saturating_sub(least),
                },
                CtlMode::Torque => Mode::Torque { full },
                CtlMode::Voltage => Mode::Voltage,
            },
            period_s: scale.period_s,
            test_full: test_current(params, scale),
        }
    }

    /// Returns the set-point of a note, octaves lower if the control period is too long for its pitch.
    fn tone(&self, note: Note) -> Setpoint {
        let Note::Pitch { hz } = note else {
            return Setpoint::Tone(Speed::ZERO);
        };
        let mut pitch = Speed::from_f32(f32::from(hz) * self.period_s);
        while pitch > tone::PITCH_MAX {
            pitch = pitch / 2;
        }
        Setpoint::Tone(pitch)
    }

    /// Returns the set-point of what is granted.
    pub fn setpoint(&self, granted: Granted<&Use>) -> Setpoint {
        match granted.demanded() {
            Demanded::Command(command) => self.commanded(command),
            Demanded::Use(Use::Note(note)) => self.tone(*note),
            Demanded::Use(Use::Measure(setpoint)) => *setpoint,
        }
    }

    fn commanded(&self, command: Command) -> Setpoint {
        match (command, self.mode) {
            (Command::Stop, _) => Setpoint::Stop,
            (Command::Zero, _) => Setpoint::Zero,
            (Command::Throttle(throttle), Mode::Speed { least, span }) => {
                let (share, reversed) = split(throttle);
                let above = share.top(span).scaled();
                let speed = least.plus(above);
                Setpoint::Speed(if reversed { -speed } else { speed })
            }
            (Command::Throttle(throttle), Mode::Torque { full }) => {
                Setpoint::Torque(share_of(throttle, full))
            }
            (Command::Throttle(throttle), Mode::Voltage) => {
                let (share, reversed) = split(throttle);
                Setpoint::Voltage(if reversed { -share } else { share })
            }
            (Command::Test(value), _) => Setpoint::Test(share_of(value, self.test_full)),
        }
    }
}

/// Splits a throttle into its share and whether it is reversed.
fn split(throttle: Share) -> (Share, bool) {
    if throttle.is_negative() {
        (reverse(throttle), true)
    } else {
        (throttle, false)
    }
}

fn share_of(throttle: Share, full: Current) -> Current {
    let (share, reversed) = split(throttle);
    let current: Current = share.top(full).scaled();
    if reversed { -current } else { current }
}

#[cfg(test)]
mod tests {
    use siskin_params::{BOSSO_BENCH, Board};

    use super::*;
    use crate::build::scale;

    fn mapping(mode: f32) -> (Mapping, Scale) {
        let mut params = Params::of(&BOSSO_BENCH);
        params.set(ParamId::CtlMode, mode).expect("in range");
        let scale = scale(&params, &Board::BENCH);
        (Mapping::new(&params, &scale), scale)
    }

    fn rpm(throttle: f64) -> f32 {
        let (mapping, scale) = mapping(0.0);
        match mapping.commanded(Command::Throttle(Share::saturating_from_num(throttle))) {
            Setpoint::Speed(speed) => scale.rpm(speed),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn throttle_is_linear_in_speed() {
        assert!((rpm(0.0) - 300.0).abs() < 0.01);
        assert!((rpm(0.5) - 3150.0).abs() < 0.01);
        assert!((rpm(1.0) - 6000.0).abs() < 0.01);
    }

    #[test]
    fn torque_mode_and_tests_are_shares_of_the_bound() {
        let (mapping, scale) = mapping(1.0);
        let half = Share::from_num(0.5);
        let Setpoint::Torque(current) = mapping.commanded(Command::Throttle(half)) else {
            panic!("torque mode");
        };
        assert!((scale.amperes(current) - 10.0).abs() < 0.001);
        let Setpoint::Test(current) = mapping.commanded(Command::Test(half)) else {
            panic!("a test");
        };
        assert!((scale.amperes(current) - 2.0).abs() < 0.001);
    }

    #[test]
    fn voltage_mode_is_a_share_of_the_modulation() {
        let (mapping, _) = mapping(2.0);
        for share in [0.0, 0.3, 1.0].map(Share::saturating_from_num) {
            let forward = mapping.commanded(Command::Throttle(share));
            assert_eq!(forward, Setpoint::Voltage(share));
            let back = mapping.commanded(Command::Throttle(reverse(share)));
            assert_eq!(back, Setpoint::Voltage(-share));
        }
    }

    #[test]
    fn the_other_direction_mirrors_the_first_from_its_least_throttle_on() {
        for mode in [0.0, 1.0] {
            let (mapping, _) = mapping(mode);
            for share in [0.0, 0.01, 0.5, 1.0].map(Share::saturating_from_num) {
                let forward = mapping.commanded(Command::Throttle(share));
                let back = mapping.commanded(Command::Throttle(reverse(share)));
                match (forward, back) {
                    (Setpoint::Speed(a), Setpoint::Speed(b)) => assert_eq!(a, -b),
                    (Setpoint::Torque(a), Setpoint::Torque(b)) => assert_eq!(a, -b),
                    other => panic!("{other:?}"),
                }
            }
        }
        assert!((rpm(-1.0) + 6000.0).abs() < 0.01);
    }

    #[test]
    fn a_note_that_is_too_high_for_the_control_period_is_played_octaves_lower() {
        for (pwm_hz, hz, played_hz) in [
            (24_000.0, 2093, 2093.0),
            (8_000.0, 587, 587.0),
            (8_000.0, 1047, 523.5),
            (8_000.0, 2093, 523.25),
        ] {
            let mut params = Params::of(&BOSSO_BENCH);
            params.set(ParamId::PwmFreqHz, pwm_hz).expect("in range");
            params.set(ParamId::CtlRpmMax, 4000.0).expect("in range");
            let mapping = Mapping::new(&params, &scale(&params, &Board::BENCH));
            let Setpoint::Tone(pitch) = mapping.tone(Note::Pitch { hz }) else {
                panic!("a note");
            };
            let heard_hz = pitch.to_num::<f32>() * pwm_hz;
            assert!((heard_hz / played_hz - 1.0).abs() < 1e-4, "{heard_hz}");
        }
        // An eighth of the control rate is the highest pitch played unchanged.
        for pwm_hz in (8_000..=24_000_u16).step_by(8) {
            let mut params = Params::of(&BOSSO_BENCH);
            params
                .set(ParamId::PwmFreqHz, f32::from(pwm_hz))
                .expect("in range");
            params.set(ParamId::CtlRpmMax, 4000.0).expect("in range");
            let mapping = Mapping::new(&params, &scale(&params, &Board::BENCH));
            for (hz, octaves) in [(pwm_hz / 8, 1.0), (pwm_hz / 8 + 1, 0.5)] {
                let Setpoint::Tone(pitch) = mapping.tone(Note::Pitch { hz }) else {
                    panic!("a note");
                };
                let heard_hz = pitch.to_num::<f32>() * f32::from(pwm_hz);
                let share = heard_hz / f32::from(hz);
                assert!((share - octaves).abs() < 1e-4, "{pwm_hz}: {heard_hz}");
            }
        }
        let (mapping, _) = mapping(0.0);
        assert_eq!(mapping.tone(Note::Rest), Setpoint::Tone(Speed::ZERO));
    }

    #[test]
    fn stop_is_stop_and_zero_is_zero() {
        let (mapping, _) = mapping(0.0);
        assert_eq!(mapping.commanded(Command::Stop), Setpoint::Stop);
        assert_eq!(mapping.commanded(Command::Zero), Setpoint::Zero);
    }
}
