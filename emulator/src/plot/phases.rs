//! The drive's activity in a recording: its successive phases, and its faults.

use plotters::style::RGBColor;
use siskin_control::drive::Phase;

use super::read::Recording;

/// A stretch of time in one phase.
pub(super) struct Span {
    pub(super) phase: Phase,
    pub(super) t0_s: f64,
    pub(super) t1_s: f64,
}

/// Returns the stretches of the drive's phases.
pub(super) fn spans(recording: &Recording) -> Vec<Span> {
    let mut column = 0;
    let chunks = recording.phases.chunk_by(|a, b| a == b);
    let spans = chunks.filter_map(|chunk| {
        let first = column;
        column += chunk.len();
        chunk[0].map(|phase| Span {
            phase,
            t0_s: recording.edge_s(first as f64),
            t1_s: recording.edge_s(column as f64),
        })
    });
    spans.collect()
}

/// Returns when faults begin, s.
pub(super) fn fault_times(recording: &Recording) -> Vec<f64> {
    let mut before = 0;
    let columns = recording.faults.iter().enumerate();
    let begins = columns.filter_map(|(column, &bits)| {
        let new = bits & !before != 0;
        before = bits;
        new.then(|| recording.edge_s(column as f64))
    });
    begins.collect()
}

/// Returns the background of a phase; `None` if nothing happens.
pub(super) fn tint(phase: Phase) -> Option<RGBColor> {
    match phase {
        Phase::Idle => None,
        Phase::Sense => Some(RGBColor(0xf2, 0xf2, 0xfb)),
        Phase::Charge => Some(RGBColor(0xf9, 0xe4, 0xd8)),
        Phase::Park => Some(RGBColor(0xfd, 0xf1, 0xcf)),
        Phase::Ramp => Some(RGBColor(0xdf, 0xef, 0xfa)),
        Phase::Run => Some(RGBColor(0xe9, 0xf6, 0xf0)),
        Phase::Stopping => Some(RGBColor(0xf8, 0xe8, 0xf1)),
        Phase::Brake => Some(RGBColor(0xe6, 0xe6, 0xe6)),
        Phase::Tone => Some(RGBColor(0xec, 0xe4, 0xf7)),
    }
}

pub(super) fn name(phase: Phase) -> &'static str {
    match phase {
        Phase::Idle => "Idle",
        Phase::Sense => "Sense",
        Phase::Charge => "Charge",
        Phase::Park => "Park",
        Phase::Ramp => "Ramp",
        Phase::Run => "Run",
        Phase::Stopping => "Stopping",
        Phase::Brake => "Brake",
        Phase::Tone => "Tone",
    }
}
