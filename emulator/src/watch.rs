//! Observes a run: its figures, and a recording if wanted.

use siskin_control::telemetry::Telemetry;
use thiserror::Error;

use crate::machine::Onlooker;
use crate::plant::Gate;
use crate::record::{RecordError, Recorder};
use crate::rig::{Period, Rig};
use crate::summary::{Report, Summary};
use crate::surroundings::Passage;

/// Why a run cannot go on; one line.
#[derive(Debug, Error)]
pub enum WatchError {
    /// The recording cannot be written.
    #[error("{0}")]
    Record(#[from] RecordError),
    /// It is void.
    #[error("{0}")]
    Void(#[from] Void),
}

/// Why what is simulated is void; one line.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum Void {
    /// The simulated motor has diverged, or its shaft has run away.
    #[error(
        "the simulated motor diverged at {t_s:.6} s, beyond a million rpm: its inertia is too small for its load, for \
         a torque on the shaft, or for the PWM frequency"
    )]
    Diverged {
        /// When, s.
        t_s: f64,
    },
    /// Both switches of a leg are on, which no command may do.
    #[error(
        "both switches of the leg of phase {phase} are on at {t_s:.6} s: there is no dead time between them"
    )]
    Both {
        /// The phase, from 0.
        phase: usize,
        /// When, s: the period's start if only that is known.
        t_s: f64,
    },
}

impl Void {
    /// Returns why a period makes the run void, if it does.
    pub fn of(t_s: f64, period: &Period, rig: &Rig) -> Option<Self> {
        if period.motion.diverged() {
            return Some(Self::Diverged { t_s });
        }
        let phase = rig.plant().crossed()?;
        Some(Self::Both { phase, t_s })
    }
}

/// The onlooker.
pub struct Watch {
    summary: Summary,
    recorder: Option<Recorder>,
    failed: Option<WatchError>,
}

impl Watch {
    /// Creates a watch with figures in these windows (name, start and end, s) that records what it
    /// sees.
    pub fn new(
        windows: impl IntoIterator<Item = (String, f64, f64)>,
        recorder: Option<Recorder>,
    ) -> Self {
        Self {
            summary: Summary::new(windows),
            recorder,
            failed: None,
        }
    }

    /// Returns true if the run cannot go on.
    pub fn failed(&self) -> bool {
        self.failed.is_some()
    }

    /// Ends the recording and returns the figures, after `sim_s` simulated and `wall_s` real
    /// seconds.
    pub fn finish(self, sim_s: f64, wall_s: f64) -> Result<Report, WatchError> {
        if let Some(error) = self.failed {
            return Err(error);
        }
        if let Some(recorder) = self.recorder {
            recorder.finish()?;
        }
        Ok(self.summary.report(sim_s, wall_s))
    }
}

/// The onlookers of several ESCs, one each.
pub struct Watches {
    each: Vec<Watch>,
    esc: usize,
}

impl Watches {
    /// Creates them from one per ESC.
    pub fn new(each: Vec<Watch>) -> Self {
        Self { each, esc: 0 }
    }

    /// Returns true if the run cannot go on.
    pub fn failed(&self) -> bool {
        self.each.iter().any(Watch::failed)
    }

    /// Ends the recordings and returns the figures, after `sim_s` simulated and `wall_s` real
    /// seconds.
    pub fn finish(self, sim_s: f64, wall_s: f64) -> Result<Report, WatchError> {
        let reports = self.each.into_iter();
        let reports = reports.map(|watch| watch.finish(sim_s, wall_s));
        let reports = reports.collect::<Result<_, _>>()?;
        Ok(Report::of(reports, sim_s, wall_s))
    }
}

impl Onlooker for Watches {
    fn esc(&mut self, esc: usize) {
        self.esc = esc;
    }

    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self.each[self.esc].period(t_s, period, rig);
    }

    fn passage(&mut self, t_s: f64, passage: &Passage) {
        self.each[self.esc].passage(t_s, passage);
    }

    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) {
        self.each[self.esc].gates(time_ns, leg, gate);
    }

    fn tasks(&mut self, telemetry: &Telemetry) {
        self.each[self.esc].tasks(telemetry);
    }

    fn edge(&mut self, time_ns: u64, level: bool) {
        self.each[self.esc].edge(time_ns, level);
    }

    fn frame(&mut self, time_ns: u64, frame: &[u8]) {
        self.each[self.esc].frame(time_ns, frame);
    }
}

impl Watch {
    /// The first reason counts: what follows from it comes in the same slice.
    fn fail(&mut self, void: Void) {
        self.failed.get_or_insert(void.into());
    }

    fn record(&mut self, write: impl FnOnce(&mut Recorder) -> Result<(), RecordError>) {
        if let Some(recorder) = &mut self.recorder
            && self.failed.is_none()
        {
            self.failed = write(recorder).err().map(WatchError::Record);
        }
    }
}

impl Onlooker for Watch {
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self.summary.add(t_s, period, rig);
        if let Some(void) = Void::of(t_s, period, rig) {
            self.fail(void);
        }
        self.record(|recorder| recorder.period(t_s, period, rig));
    }

    fn passage(&mut self, t_s: f64, passage: &Passage) {
        self.summary.pass(t_s, passage);
        if passage.motion.diverged() {
            self.fail(Void::Diverged { t_s });
        }
        self.record(|recorder| recorder.passage(t_s, passage));
    }

    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) {
        if gate.shoots() {
            let t_s = time_ns as f64 * 1e-9;
            self.fail(Void::Both { phase: leg, t_s });
        }
        self.record(|recorder| recorder.gates(time_ns, leg, gate));
    }

    fn tasks(&mut self, telemetry: &Telemetry) {
        self.summary.told(telemetry);
    }

    fn edge(&mut self, time_ns: u64, level: bool) {
        self.record(|recorder| recorder.edge(time_ns, level));
    }

    fn frame(&mut self, time_ns: u64, frame: &[u8]) {
        self.record(|recorder| recorder.frame(time_ns, frame));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_switches_of_a_leg_end_a_run() {
        let mut watch = Watch::new(Vec::new(), None);
        let on = |high, low| Gate { high, low };
        for gate in [on(true, false), on(false, false), on(false, true)] {
            watch.gates(1_000_000, 2, gate);
            assert!(!watch.failed());
        }
        watch.gates(2_000_000, 2, on(true, true));
        assert!(watch.failed());
        let line = watch.finish(1.0, 1.0).unwrap_err().to_string();
        assert!(line.contains("phase 2 are on at 0.002000 s"), "{line}");
    }
}
