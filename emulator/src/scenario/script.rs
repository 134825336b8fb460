//! A scenario's throttle and faults, played on what is already running, and its expectations of that.
//!
//! The bench and the ESC's knowledge stay as they are: `[bench]` and `[params]` are for a separate run.

use std::path::Path;

use serde::Serialize;
use toml::Value;

use super::error::ScenarioError;
use super::file::{Expectation, Scenario};
use super::judge::judge;
use super::lines::reason;
use super::signal::{Demand, Signal, demand};
use crate::fault::Fault;
use crate::summary::Summary;

/// The parts of a file that are played; of the bench only its duration.
const KEPT: [&str; 5] = ["bench", "signal", "fault", "window", "expect"];

/// What is played.
pub struct Script {
    signals: Vec<Signal>,
    /// By start time.
    faults: Vec<Fault>,
    duration_s: f64,
    windows: Vec<(String, f64, f64)>,
    expect: Vec<Expectation>,
}

/// How a play ended.
#[derive(Clone, Debug, Serialize)]
pub struct Ending {
    /// The faults that occurred; `None` if the control is not visible.
    pub faults: Option<Vec<&'static str>>,
    /// Each expectation, in a sentence, and whether it held; `None` if that cannot be seen.
    pub expectations: Vec<(String, Option<bool>)>,
}

impl Script {
    /// Reads a scenario's text.
    ///
    /// # Errors
    /// A line on what is wrong with it, or why it cannot be played here.
    pub fn read(text: &str) -> Result<Self, String> {
        let here = Path::new("");
        // As it stands it must make sense, and errors have a line in it.
        toml::from_str::<Scenario>(text).map_err(|error| reason(text, &error))?;
        let mut root: toml::Table = text.parse().map_err(|error| reason(text, &error))?;
        if root.contains_key("sweep") || root.contains_key("random") {
            return Err("a scenario that stands for many runs is not played here".to_owned());
        }
        root.retain(|key, _| KEPT.contains(&key));
        if let Some(Value::Table(bench)) = root.get_mut("bench") {
            bench.retain(|key, _| key == "duration_s");
        }
        let line = |error: ScenarioError| error.in_file(text, &[]).to_string();
        let root = Scenario::complete(root, here).map_err(line)?;
        let scenario = Scenario::understand(root).map_err(line)?;
        super::play::check(&scenario).map_err(line)?;
        if scenario.signal.iter().any(|signal| signal.path.is_some()) {
            // A page provides text, and has no right to this machine's files.
            return Err("a course in a file of its own is not played here".to_owned());
        }
        let past = scenario.signal.iter().position(|signal| {
            !matches!(
                demand(&scenario.signal, signal.at_s),
                Some(Demand::Throttle(_))
            )
        });
        if let Some(index) = past {
            return Err(format!(
                "signal.{index} goes past the wire; give throttle for a scenario that is played here"
            ));
        }
        if scenario.signal.first().is_some_and(|first| {
            demand(&scenario.signal, first.at_s) != Some(Demand::Throttle(0.0))
        }) {
            return Err("give zero throttle first, which arms".to_owned());
        }
        let mut faults = scenario.faults().map_err(line)?;
        faults.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        Ok(Self {
            windows: super::play::windows(&scenario).collect(),
            signals: scenario.signal,
            faults,
            duration_s: scenario.bench.duration_s,
            expect: scenario.expect,
        })
    }

    /// Returns the throttle at a time after its start, 0 to 1; `None` once it is over.
    pub fn throttle(&self, t_s: f64) -> Option<f64> {
        if t_s >= self.duration_s {
            return None;
        }
        match demand(&self.signals, t_s) {
            Some(Demand::Throttle(throttle)) => Some(throttle),
            _ => Some(0.0),
        }
    }

    /// Returns a summary of its windows, for periods by their time after its start.
    pub fn summary(&self) -> Summary {
        Summary::new(self.windows.iter().cloned())
    }

    /// Compares the figures of the whole play with what is expected.
    ///
    /// # Errors
    /// A line on an expectation that means nothing; [`Self::read`] has refused those.
    pub fn ending(&self, summary: &Summary) -> Result<Ending, String> {
        let report = summary.report(self.duration_s, 0.0);
        let verdicts = self.expect.iter().map(|expected| {
            let verdict = judge(expected, &report).map_err(|error| error.to_string())?;
            Ok((verdict.sentence(), verdict.held))
        });
        let expectations = verdicts.collect::<Result<_, String>>()?;
        Ok(Ending {
            faults: report.faults,
            expectations,
        })
    }

    /// Returns the faults, by start time relative to its start.
    pub fn faults(&self) -> &[Fault] {
        &self.faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "
        bench.duration_s = 2.0
        signal = [{ at_s = 0.0, throttle = 0.0 }, { at_s = 0.6, throttle = 0.5, shape = \"ramp\", for_s = 0.2 }]
        fault = [
            { at_s = 1.5, kind = \"reset\" },
            { at_s = 1.0, for_s = 0.1, kind = \"bus_sag\", value = 4.0 },
        ]
        window = [{ name = \"steady\", t0_s = 1.0, t1_s = 2.0 }]
    ";

    #[test]
    fn throttle_and_faults_are_those_of_the_file() {
        let script = Script::read(TEXT).unwrap();
        let throttle = [0.0, 0.5, 0.7, 1.9].map(|t_s| script.throttle(t_s).unwrap());
        assert_eq!(throttle[..2], [0.0, 0.0]);
        assert!((throttle[2] - 0.25).abs() < 1e-9 && throttle[3] == 0.5);
        assert_eq!(script.throttle(2.0), None);
        let begin: Vec<_> = script.faults().iter().map(|fault| fault.at_s).collect();
        assert_eq!(begin, [1.0, 1.5]);
    }

    #[test]
    fn what_cannot_be_played_here_is_told() {
        for (text, told) in [
            ("signal = 3", "line 1"),
            (
                "signal = [{ at_s = 0.0, rpm = 3000.0 }]",
                "goes past the wire",
            ),
            (
                "signal = [{ at_s = 0.0, throttle = 0.5 }]",
                "zero throttle first",
            ),
            (
                "signal = [{ at_s = 0.0, throttle = 0.0, shape = \"file\", path = \"a.csv\" }]",
                "course in a file",
            ),
            (
                "sweep = { \"params.MOT_R_MOHM\" = [75.6, 108.0] }",
                "many runs",
            ),
            ("fault = [{ at_s = 0.0, kind = \"mosfet_short\" }]", "phase"),
            ("[bench", "line 1"),
        ] {
            let line = Script::read(text).err().expect(text);
            assert!(line.contains(told), "{text}: {line}");
        }
    }
}
