//! The commands to the drive over time.

use std::f64::consts::{PI, TAU};
use std::path::PathBuf;
use std::sync::Arc;

use serde::Deserialize;

use super::course::{Course, NUMBER_MAX};

/// The shortest duration of a shape, s: far below a control period.
const FOR_LEAST_S: f64 = 1e-6;

/// An entry of the time line; it applies until the next.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Signal {
    /// Start time.
    pub(super) at_s: f64,
    /// Throttle on the wire, 0 to 1; 0 is motor stop.
    pub(super) throttle: Option<f64>,
    /// Speed, bypassing the wire; negative is reverse.
    pub(super) rpm: Option<f64>,
    /// Torque current, bypassing the wire.
    pub(super) amps: Option<f64>,
    /// How the value evolves.
    #[serde(default)]
    pub(super) shape: Shape,
    /// Duration of a ramp, of a modulated sine or of a chirp.
    pub(super) for_s: Option<f64>,
    /// Amplitude of a sine or chirp.
    #[serde(default)]
    pub(super) amplitude: f64,
    /// Frequency of a sine, first frequency of a chirp.
    #[serde(default)]
    pub(super) freq_hz: f64,
    /// Last frequency of a chirp.
    pub(super) freq_to_hz: Option<f64>,
    /// Whether a sine's amplitude swells and fades once over `for_s`.
    #[serde(default)]
    pub(super) am: bool,
    /// File of a course; a relative path is beside the scenario.
    pub(super) path: Option<PathBuf>,
    /// The contents of that file.
    #[serde(skip)]
    pub(super) course: Option<Arc<Course>>,
}

/// How a value evolves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Shape {
    /// At once.
    #[default]
    Step,
    /// From the previous value, linearly over `for_s`.
    Ramp,
    /// Value + amplitude·sin(2π·freq_hz·t), times sin²(π·t/for_s) with `am`.
    Sine,
    /// Likewise, with the frequency rising linearly to `freq_to_hz` over `for_s`.
    Chirp,
    /// Value + the file's at the time since `at_s`.
    File,
}

/// The command at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Demand {
    /// Throttle on the wire.
    Throttle(f64),
    /// Mechanical speed, rpm; negative is reverse.
    Rpm(f64),
    /// Torque current, A.
    Amps(f64),
}

impl Signal {
    /// Returns what is wrong with it, if anything, and the key that it is about.
    pub(super) fn problem(&self) -> Option<(&'static str, &'static str)> {
        let given = [
            ("throttle", self.throttle),
            ("rpm", self.rpm),
            ("amps", self.amps),
        ];
        let numbers = [
            ("at_s", Some(self.at_s)),
            ("for_s", self.for_s),
            ("amplitude", Some(self.amplitude)),
            ("freq_hz", Some(self.freq_hz)),
            ("freq_to_hz", self.freq_to_hz),
        ];
        let numbers = given.into_iter().chain(numbers);
        let is_wild = |x: f64| !(-NUMBER_MAX..=NUMBER_MAX).contains(&x);
        let mut wild = numbers.filter(|(_, x)| x.is_some_and(is_wild));
        let count = given.iter().filter(|(_, x)| x.is_some()).count();
        let lasts = match self.shape {
            Shape::Step | Shape::File => false,
            Shape::Sine => self.am,
            Shape::Ramp | Shape::Chirp => true,
        };
        if count == 0 {
            Some(("throttle", "give it, or rpm, or amps"))
        } else if count > 1 {
            Some(("throttle", "give one of throttle, rpm and amps, not more"))
        } else if let Some((key, _)) = wild.next() {
            Some((key, "give a number within ±1e9"))
        } else if self.throttle.is_some_and(|t| !(0.0..=1.0).contains(&t)) {
            Some(("throttle", "give 0 to 1"))
        } else if lasts && !self.for_s.is_some_and(|s| s >= FOR_LEAST_S) {
            Some(("for_s", "the shape needs it, 1e-6 or more"))
        } else if self.shape == Shape::Chirp && self.freq_to_hz.is_none() {
            Some(("freq_to_hz", "a chirp needs it"))
        } else if self.shape == Shape::File && self.path.is_none() {
            Some(("path", "the shape file needs it, the path of a CSV file"))
        } else if self.shape != Shape::File && self.path.is_some() {
            Some(("path", "is for shape = \"file\""))
        } else {
            None
        }
    }

    /// Returns the value at `t_s` after the start of the scenario, with `before` previously in
    /// force.
    fn demand(&self, t_s: f64, before: Option<f64>) -> Demand {
        let t = t_s - self.at_s;
        let length = self.for_s.unwrap_or(f64::INFINITY);
        let value = |base: f64| match self.shape {
            Shape::Step => base,
            Shape::Ramp => {
                let from = before.unwrap_or(0.0);
                from + (base - from) * (t / length).min(1.0)
            }
            Shape::Sine => {
                let swell = if self.am && t >= length {
                    0.0
                } else if self.am {
                    libm::pow(libm::sin(PI * t / length), 2.0)
                } else {
                    1.0
                };
                base + self.amplitude * swell * libm::sin(TAU * self.freq_hz * t)
            }
            Shape::Chirp => {
                let t = t.min(length);
                let rate = (self.freq_to_hz.unwrap_or(self.freq_hz) - self.freq_hz) / length;
                let turns = (self.freq_hz + 0.5 * rate * t) * t;
                base + self.amplitude * libm::sin(TAU * turns)
            }
            Shape::File => base + self.course.as_ref().map_or(0.0, |course| course.at(t)),
        };
        match (self.throttle, self.rpm, self.amps) {
            (Some(throttle), ..) => Demand::Throttle(value(throttle).clamp(0.0, 1.0)),
            (_, Some(rpm), _) => Demand::Rpm(value(rpm)),
            (.., amps) => Demand::Amps(value(amps.unwrap_or(0.0))),
        }
    }

    /// Returns the value from which a following ramp starts.
    fn end(&self) -> Option<f64> {
        let base = self.throttle.or(self.rpm).or(self.amps)?;
        let course = self.course.as_ref();
        Some(base + course.map_or(0.0, |course| course.at(f64::INFINITY)))
    }
}

/// Returns the command at `t_s`, or `None` before the first entry. The entries are in order.
pub(super) fn demand(signals: &[Signal], t_s: f64) -> Option<Demand> {
    let next = signals.partition_point(|signal| signal.at_s <= t_s);
    let current = signals.get(next.checked_sub(1)?)?;
    let before = next.checked_sub(2).and_then(|index| signals[index].end());
    Some(current.demand(t_s, before))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signals(text: &str) -> Vec<Signal> {
        #[derive(Deserialize)]
        struct Holder {
            signal: Vec<Signal>,
        }
        toml::from_str::<Holder>(text).unwrap().signal
    }

    #[test]
    fn shapes_follow_their_formulas() {
        let signals = signals(
            "signal = [{ at_s = 0.0, rpm = 1000.0 },
                       { at_s = 1.0, rpm = 2000.0, shape = 'ramp', for_s = 2.0 },
                       { at_s = 4.0, rpm = 3000.0, shape = 'sine', amplitude = 100.0,
                         freq_hz = 1.0, for_s = 2.0, am = true },
                       { at_s = 8.0, amps = 2.0, shape = 'chirp', amplitude = 1.0, freq_hz = 1.0,
                         freq_to_hz = 3.0, for_s = 2.0 }]",
        );
        let at = |t_s| demand(&signals, t_s);
        assert_eq!(at(-0.1), None);
        assert_eq!(at(0.5), Some(Demand::Rpm(1000.0)));
        assert_eq!(at(2.0), Some(Demand::Rpm(1500.0)));
        assert_eq!(at(3.5), Some(Demand::Rpm(2000.0)));
        // sin²(π·0.25/2)·sin(2π·0.25) = 0.1464.
        let Some(Demand::Rpm(rpm)) = at(4.25) else {
            panic!()
        };
        assert!((rpm - 3014.64).abs() < 0.01, "{rpm}");
        assert_eq!(at(7.0), Some(Demand::Rpm(3000.0)));
        // (1 + 0.5·1·0.5)·0.5 = 0.625 turns.
        let Some(Demand::Amps(amps)) = at(8.5) else {
            panic!()
        };
        assert!(
            (amps - (2.0 + libm::sin(TAU * 0.625))).abs() < 1e-9,
            "{amps}"
        );
    }

    #[test]
    fn a_course_adds_to_the_value_and_a_ramp_goes_on_from_its_end() {
        let mut signals = signals(
            "signal = [{ at_s = 1.0, rpm = 100.0, shape = 'file', path = 'x.csv' },
                       { at_s = 5.0, rpm = 0.0, shape = 'ramp', for_s = 1.0 }]",
        );
        let course = Course::parse(b"0.5,1000\n1.5,3000").unwrap();
        signals[0].course = Some(Arc::new(course));
        let at = |t_s| demand(&signals, t_s);
        assert_eq!(at(1.0), Some(Demand::Rpm(1100.0)));
        assert_eq!(at(2.0), Some(Demand::Rpm(2100.0)));
        assert_eq!(at(4.0), Some(Demand::Rpm(3100.0)));
        assert_eq!(at(5.5), Some(Demand::Rpm(1550.0)));
    }

    #[test]
    fn problems_are_named() {
        let problem = |entry: &str| signals(&format!("signal = [{entry}]"))[0].problem();
        assert!(problem("{ at_s = 0.0, rpm = 1.0 }").is_none());
        assert!(problem("{ at_s = 0.0 }").is_some());
        assert!(problem("{ at_s = 0.0, throttle = 1.5 }").is_some());
        assert!(problem("{ at_s = 0.0, rpm = 1.0, shape = 'ramp' }").is_some());
        let key = |entry: &str| problem(entry).unwrap().0;
        assert_eq!(key("{ at_s = 0.0, rpm = 1.0, amps = 1.0 }"), "throttle");
        assert_eq!(key("{ at_s = inf, rpm = 1.0 }"), "at_s");
        assert_eq!(key("{ at_s = 0.0, rpm = -2e9 }"), "rpm");
        assert_eq!(
            key("{ at_s = 0.0, rpm = 1.0, shape = 'ramp', for_s = 1e-300 }"),
            "for_s"
        );
        assert_eq!(
            key("{ at_s = 0.0, rpm = 1.0, shape = 'sine', am = true }"),
            "for_s"
        );
        assert_eq!(key("{ at_s = 0.0, rpm = 1.0, shape = 'file' }"), "path");
        assert_eq!(key("{ at_s = 0.0, rpm = 1.0, path = 'x.csv' }"), "path");
    }
}
