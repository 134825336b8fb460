//! Instruction counts of control periods, by what the drive did in them.

use std::fmt;

use siskin_control::drive::Phase;

use crate::record::Label;

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

/// The counts of a run.
pub(crate) struct Counts {
    /// All periods.
    pub(crate) all: Spread,
    /// Periods with a fault.
    latched: Option<Spread>,
    /// Periods without one.
    phases: Vec<(Phase, Spread)>,
}

impl Counts {
    pub(crate) fn new(labels: &[Label], counts: &[u32]) -> Self {
        let spread = |wanted: &dyn Fn(&Label) -> bool| {
            let periods = labels.iter().zip(counts);
            Spread::of(
                periods
                    .filter(|(label, _)| wanted(label))
                    .map(|(_, &count)| count)
                    .collect(),
            )
        };
        let of_phase = |phase| spread(&|label| label.phase == phase && !label.latched);
        Self {
            all: spread(&|_| true).expect("a run has periods"),
            latched: spread(&|label| label.latched),
            phases: Phase::ALL
                .into_iter()
                .filter_map(|phase| Some((phase, of_phase(phase)?)))
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
            "{:<10}{:>8}{:>7}{:>8}{:>6}",
            "", "periods", "least", "median", "most"
        )?;
        let mut row = |name: &str, spread: &Spread| {
            let Spread {
                periods,
                least,
                median,
                most,
            } = spread;
            writeln!(f, "{name:<10}{periods:>8}{least:>7}{median:>8}{most:>6}")
        };
        for (phase, spread) in &self.phases {
            row(&format!("{phase:?}"), spread)?;
        }
        if let Some(spread) = &self.latched {
            row("a fault", spread)?;
        }
        row("all", &self.all)
    }
}
