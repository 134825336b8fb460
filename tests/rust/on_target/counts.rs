//! Instruction counts of control periods, by what the drive did in them.

use std::fmt;

use siskin_control::drive::Phase;

use crate::record::Label;

/// Periods before a steady one in which neither the mode nor the kind of set-point has changed: a cycle of the schedule.
const STEADY: usize = 32;

/// Minimum, median and maximum of counts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spread {
    pub(crate) periods: usize,
    pub(crate) least: u32,
    pub(crate) median: u32,
    pub(crate) most: u32,
}

impl Spread {
    /// Returns `None` without counts.
    fn of(mut counts: Vec<u32>) -> Option<Self> {
        counts.sort_unstable();
        Some(Self {
            periods: counts.len(),
            least: *counts.first()?,
            median: counts[counts.len() / 2],
            most: *counts.last()?,
        })
    }
}

/// The counts of one or several runs.
pub(crate) struct Counts {
    /// All periods.
    pub(crate) all: Spread,
    /// Those of Run in which all is as it has been for a while.
    pub(crate) steady: Option<Spread>,
    /// Periods with a fault.
    latched: Option<Spread>,
    /// Periods without one.
    phases: Vec<(Phase, Spread)>,
    /// Those around a change from one mode to another: the last of the one, and the first two of the other.
    changes: Vec<([Phase; 2], Spread)>,
}

impl Counts {
    /// Counts the periods of runs, each with its labels.
    pub(crate) fn new(runs: &[(Vec<Label>, Vec<u32>)]) -> Self {
        let spread = |wanted: &dyn Fn(&[Label], usize) -> bool| {
            let periods = runs.iter().flat_map(|(labels, counts)| {
                let wanted = (0..counts.len()).filter(|n| wanted(labels, *n));
                wanted.map(|n| counts[n])
            });
            Spread::of(periods.collect())
        };
        let of_phase = |phase| {
            spread(&|labels, n| labels[n].phase == phase && !labels[n].latched)
                .map(|spread| (phase, spread))
        };
        let of_change = |change: [Phase; 2]| {
            spread(&|labels, n| {
                let pairs = labels[n.saturating_sub(2)..].windows(2).take(3);
                pairs
                    .map(|two| [two[0].phase, two[1].phase])
                    .any(|seen| seen == change)
            })
            .map(|spread| (change, spread))
        };
        let pairs = Phase::ALL
            .into_iter()
            .flat_map(|from| Phase::ALL.map(|to| [from, to]));
        Self {
            all: spread(&|_, _| true).expect("a run has periods"),
            steady: spread(&|labels, n| {
                n >= STEADY
                    && labels[n].phase == Phase::Run
                    && labels[n - STEADY..n]
                        .iter()
                        .all(|label| *label == labels[n])
            }),
            latched: spread(&|labels, n| labels[n].latched),
            phases: Phase::ALL.into_iter().filter_map(of_phase).collect(),
            changes: pairs
                .filter(|[from, to]| from != to)
                .filter_map(of_change)
                .collect(),
        }
    }

    /// Returns whether a fault was ever latched.
    pub(crate) fn has_faults(&self) -> bool {
        self.latched.is_some()
    }

    /// Returns whether the drive was ever in this phase.
    pub(crate) fn has(&self, phase: Phase) -> bool {
        self.phases.iter().any(|(seen, _)| *seen == phase)
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{:<20}{:>8}{:>7}{:>8}{:>6}",
            "", "periods", "least", "median", "most"
        )?;
        let mut row = |name: &str, spread: &Spread| {
            let Spread {
                periods,
                least,
                median,
                most,
            } = spread;
            writeln!(f, "{name:<20}{periods:>8}{least:>7}{median:>8}{most:>6}")
        };
        for (phase, spread) in &self.phases {
            row(&format!("{phase:?}"), spread)?;
        }
        if let Some(spread) = &self.latched {
            row("a fault", spread)?;
        }
        for ([from, to], spread) in &self.changes {
            row(&format!("{from:?} to {to:?}"), spread)?;
        }
        if let Some(spread) = &self.steady {
            row("steady flight", spread)?;
        }
        row("all", &self.all)
    }
}
