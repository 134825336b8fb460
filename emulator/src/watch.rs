//! Looks on at a run: figures of it, and a recording where one is wanted.

use thiserror::Error;

use crate::machine::Onlooker;
use crate::plant::Gate;
use crate::record::{RecordError, Recorder};
use crate::rig::{Period, Rig};
use crate::summary::{Report, Summary};
use crate::surroundings::{Motion, Passage};

/// Why a run cannot go on; one line.
#[derive(Debug, Error)]
pub enum WatchError {
    /// The recording cannot be written.
    #[error("{0}")]
    Record(#[from] RecordError),
    /// The simulated motor has left all bounds.
    #[error(
        "the simulated motor diverged: its inertia is too small for its load and the PWM frequency"
    )]
    Diverged,
}

/// The onlooker.
pub struct Watch {
    summary: Summary,
    recorder: Option<Recorder>,
    failed: Option<WatchError>,
}

impl Watch {
    /// Takes figures in these windows (name, start and end, s), and records what it sees.
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

    /// Whether the run cannot go on.
    pub fn failed(&self) -> bool {
        self.failed.is_some()
    }

    /// Ends the recording and gives the figures, after `sim_s` simulated and `wall_s` real seconds.
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

/// The onlookers of several ESCs, each of its own.
pub struct Watches {
    each: Vec<Watch>,
    esc: usize,
}

impl Watches {
    /// One for each ESC.
    pub fn new(each: Vec<Watch>) -> Self {
        Self { each, esc: 0 }
    }

    /// Whether the run cannot go on.
    pub fn failed(&self) -> bool {
        self.each.iter().any(Watch::failed)
    }

    /// Ends the recordings and gives the figures, after `sim_s` simulated and `wall_s` real seconds.
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

    fn edge(&mut self, time_ns: u64, level: bool) {
        self.each[self.esc].edge(time_ns, level);
    }

    fn frame(&mut self, time_ns: u64, frame: &[u8]) {
        self.each[self.esc].frame(time_ns, frame);
    }
}

impl Watch {
    fn check(&mut self, motion: &Motion) {
        if motion.diverged() {
            self.failed = Some(WatchError::Diverged);
        }
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
        self.check(&period.motion);
        self.record(|recorder| recorder.period(t_s, period, rig));
    }

    fn passage(&mut self, t_s: f64, passage: &Passage) {
        self.summary.pass(t_s, passage);
        self.check(&passage.motion);
        self.record(|recorder| recorder.passage(t_s, passage));
    }

    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) {
        self.record(|recorder| recorder.gates(time_ns, leg, gate));
    }

    fn edge(&mut self, time_ns: u64, level: bool) {
        self.record(|recorder| recorder.edge(time_ns, level));
    }

    fn frame(&mut self, time_ns: u64, frame: &[u8]) {
        self.record(|recorder| recorder.frame(time_ns, frame));
    }
}
