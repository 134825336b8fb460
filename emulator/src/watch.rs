//! Looks on at a run: figures of it, and a recording where one is wanted.

use std::path::Path;

use thiserror::Error;

use crate::record::{RecordError, Recorder};
use crate::rig::{Period, Rig};
use crate::shaft::Units;
use crate::summary::{Report, Summary};

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
    /// Takes figures in these windows (name, start and end, s), and records into `record`.
    pub fn new(
        windows: impl IntoIterator<Item = (String, f64, f64)>,
        record: Option<&Path>,
    ) -> Result<Self, WatchError> {
        Ok(Self {
            summary: Summary::new(windows),
            recorder: record.map(Recorder::create).transpose()?,
            failed: None,
        })
    }

    /// Takes in a period that began at `t_s`.
    pub fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self.summary.add(t_s, period, rig);
        if period.diverged() {
            self.failed = Some(WatchError::Diverged);
        }
        if let Some(recorder) = &mut self.recorder
            && self.failed.is_none()
        {
            let written = recorder.write(t_s, period, &rig.snapshot(), Units::of(rig.config()));
            self.failed = written.err().map(WatchError::Record);
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
