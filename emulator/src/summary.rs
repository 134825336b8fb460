//! The results of a run: figures over measuring windows, and a hash of the control state.

mod since;
mod trace;
mod turning;
mod window;

use serde::Serialize;
use siskin_control::drive::{Fault, Faults, Limit, Limits, Phase};
use siskin_control::telemetry::Telemetry;

use xxhash_rust::xxh3::Xxh3;

use crate::plant::Plant;
use crate::rig::{Period, Rig};
use crate::shaft::Units;
use crate::surroundings::Passage;
use trace::Trace;
pub use window::Figures;
use window::{Control, Look, Window};

/// Observes a run.
pub struct Summary {
    trace: Trace,
    steps: u64,
    /// Whether the control is not visible.
    blind: bool,
    faults: Faults,
    /// What the motor has flown on with.
    warnings: Limits,
    /// The drive's phase in the previous period.
    phase: Phase,
    /// The motor's resistance and flux as they are followed, mΩ and mWb.
    motor: [f32; 2],
    windows: Vec<Window>,
}

/// The figures of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Simulated time, s.
    pub sim_s: f64,
    /// Wall time, s.
    pub wall_s: f64,
    /// Simulated seconds per wall second.
    pub sim_per_wall: Option<f64>,
    /// Control periods, or PWM periods if the control is not visible.
    pub steps: u64,
    /// Hash over the control state of every step: 16 hexadecimal digits, equal for equal seed and
    /// inputs on any machine. If the control is not visible, over the motor's state.
    pub trace_hash: String,
    /// Faults that have turned the bridge off; `None` if the control is not visible.
    pub faults: Option<Vec<&'static str>>,
    /// What was wrong while the motor went on, if anything.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<&'static str>,
    /// Refused input from outside; `None` for a scenario, which has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rejected: Option<Rejected>,
    /// The measuring windows; none for several ESCs together.
    pub windows: Vec<Figures>,
    /// One per ESC, if there are several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub escs: Vec<Report>,
}

impl Report {
    /// Sums up several ESCs, with a hash over their hashes in order.
    fn over(escs: Vec<Self>, sim_s: f64, wall_s: f64) -> Self {
        let mut hash = Xxh3::new();
        let mut faults = Vec::new();
        for esc in &escs {
            hash.update(esc.trace_hash.as_bytes());
            faults.extend(esc.faults.iter().flatten());
        }
        let known = Fault::ALL.into_iter().map(Fault::text);
        let warned = |limit: &&'static str| escs.iter().any(|esc| esc.warnings.contains(limit));
        Self {
            sim_s,
            wall_s,
            sim_per_wall: (wall_s > 0.0).then(|| sim_s / wall_s),
            steps: escs.iter().map(|esc| esc.steps).sum(),
            trace_hash: format!("{:016x}", hash.digest()),
            faults: Some(known.filter(|fault| faults.contains(fault)).collect()),
            warnings: Limit::ALL
                .into_iter()
                .map(Limit::text)
                .filter(warned)
                .collect(),
            rejected: None,
            windows: Vec::new(),
            escs,
        }
    }

    /// Reports the only ESC, or several together.
    pub fn of(mut escs: Vec<Self>, sim_s: f64, wall_s: f64) -> Self {
        match escs.pop() {
            Some(only) if escs.is_empty() => only,
            last => Self::over(escs.into_iter().chain(last).collect(), sim_s, wall_s),
        }
    }

    /// Adds what each ESC has refused.
    pub fn with_rejected(mut self, rejected: &[Rejected]) -> Self {
        self.rejected = Some(rejected.iter().fold(Rejected::default(), Rejected::and));
        for (esc, rejected) in self.escs.iter_mut().zip(rejected) {
            esc.rejected = Some(*rejected);
        }
        self
    }
}

/// Refused input.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Rejected {
    /// Throttle-wire datagrams that were malformed or found no room.
    pub wire_datagrams: u64,
    /// Runs of edges that were no frame, or failed its check.
    pub wire_frames: u32,
    /// MAVLink frames that failed their check, are unknown, or cannot be trusted.
    pub mavlink_frames: u64,
    /// Malformed requests of a client in lockstep.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lockstep_requests: Option<u32>,
}

impl Rejected {
    /// Adds another ESC's.
    fn and(self, other: &Self) -> Self {
        Self {
            wire_datagrams: self.wire_datagrams + other.wire_datagrams,
            wire_frames: self.wire_frames + other.wire_frames,
            mavlink_frames: self.mavlink_frames + other.mavlink_frames,
            lockstep_requests: self.lockstep_requests.or(other.lockstep_requests),
        }
    }
}

impl Summary {
    /// Creates a summary with these measuring windows: name, start and end, s.
    pub fn new(windows: impl IntoIterator<Item = (String, f64, f64)>) -> Self {
        let windows = windows.into_iter();
        Self {
            trace: Trace::new(),
            steps: 0,
            blind: false,
            faults: Faults::NONE,
            warnings: Limits::NONE,
            phase: Phase::Idle,
            motor: [0.0; 2],
            windows: windows
                .map(|(name, t0_s, t1_s)| Window::new(name, t0_s, t1_s))
                .collect(),
        }
    }

    /// Adds a period that began at `t_s`.
    pub fn add(&mut self, t_s: f64, period: &Period, rig: &Rig) {
        self.steps += 1;
        self.trace.take(rig);
        let snapshot = rig.snapshot();
        if !snapshot.faults.is_empty() {
            snapshot.faults.iter().for_each(|f| self.faults.insert(f));
        }
        let starts = |phase| matches!(phase, Phase::Park | Phase::Ramp);
        let started = starts(snapshot.phase) && !starts(self.phase);
        self.phase = snapshot.phase;
        let drift_pct = self.drift_pct(rig.plant());
        for window in &mut self.windows {
            if window.covers(t_s) {
                window.add(&Look {
                    t_s,
                    motion: &period.motion,
                    control: Some(Control {
                        period,
                        snapshot: &snapshot,
                        units: Units::of(rig.config()),
                        started,
                        drift_pct,
                    }),
                });
            }
        }
    }

    /// Returns by how much the followed resistance and flux exceed the true ones, %.
    fn drift_pct(&self, plant: &Plant) -> [f64; 2] {
        let truth = [plant.resistance_ohm(), plant.flux_wb()];
        [0, 1].map(|which| 0.1 * f64::from(self.motor[which]) / truth[which] - 100.0)
    }

    /// Takes in what the tasks report.
    pub fn told(&mut self, telemetry: &Telemetry) {
        let limits = telemetry.limits.iter();
        limits
            .filter(|limit| limit.warns())
            .for_each(|warning| self.warnings.insert(warning));
        self.motor = [telemetry.r_mohm, telemetry.flux_mwb];
    }

    /// Adds a period that began at `t_s` of a machine whose control is not visible.
    pub fn pass(&mut self, t_s: f64, passage: &Passage) {
        self.steps += 1;
        self.blind = true;
        self.trace.pass(passage);
        for window in &mut self.windows {
            if window.covers(t_s) {
                window.add(&Look {
                    t_s,
                    motion: &passage.motion,
                    control: None,
                });
            }
        }
    }

    /// Returns the figures, after `sim_s` simulated and `wall_s` real seconds.
    pub fn report(&self, sim_s: f64, wall_s: f64) -> Report {
        Report {
            sim_s,
            wall_s,
            sim_per_wall: (wall_s > 0.0).then(|| sim_s / wall_s),
            steps: self.steps,
            trace_hash: format!("{:016x}", self.trace.digest()),
            faults: (!self.blind).then(|| self.faults.iter().map(Fault::text).collect()),
            warnings: self.warnings.iter().map(Limit::text).collect(),
            rejected: None,
            windows: self.windows.iter().map(|w| w.figures(sim_s)).collect(),
            escs: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::Flow;
    use crate::reference::{code, rows};
    use crate::surroundings::Motion;

    #[test]
    fn the_reference_has_every_figure() {
        let summary = Summary::new([("all".to_owned(), 0.0, 1.0)]);
        let report = summary.report(1.0, 1.0);
        let figures = serde_json::to_value(&report.windows[0]).unwrap();
        let figures: Vec<_> = figures.as_object().unwrap().keys().cloned().collect();
        let mut listed: Vec<_> = rows("Window figures")
            .iter()
            .filter_map(|row| code(&row[0]).map(str::to_owned))
            .collect();
        listed.sort();
        assert_eq!(listed, figures, "window figures in README.md");
    }

    #[test]
    fn figures_that_a_machine_does_not_show_are_those_of_its_control() {
        let mut summary = Summary::new([("all".to_owned(), 0.0, 1.0)]);
        let flow = Flow {
            torque_nm: 0.1,
            torque_square: 0.02,
            motor_w: 10.0,
            copper_w: 1.0,
            ..Flow::default()
        };
        let motion = Motion {
            angle_turns: 0.0,
            speed_rad_s: 100.0,
            currents_a: [1.0, -1.0, 0.0],
            bus_v: 24.0,
            bus_a: 0.5,
            flow,
        };
        let passage = Passage {
            length_s: 1e-4,
            motion,
            hall: 1,
        };
        summary.pass(0.5, &passage);
        let report = summary.report(1.0, 1.0);
        let figures = serde_json::to_value(&report.windows[0]).unwrap();
        let figures = figures.as_object().unwrap().iter();
        let unseen: Vec<_> = figures.filter(|(_, value)| value.is_null()).collect();
        let mut unseen: Vec<_> = unseen.iter().map(|(key, _)| key.as_str()).collect();
        let mut of_control = Figures::OF_CONTROL.to_vec();
        unseen.sort_unstable();
        of_control.sort_unstable();
        assert_eq!(unseen, of_control);
    }
}
