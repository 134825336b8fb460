//! The protocol between page and program over the socket.
//!
//! Text is JSON. Binary begins with a type byte: [`siskin_scope::MAVLINK`] frames, in both directions, or a [`TRACE`],
//! an answer to [`FromPage::View`].

use serde::Deserialize;

/// A piece of the traces follows.
pub(super) const TRACE: u8 = 1;

/// A page's request. `esc` counts from 0.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum FromPage {
    /// A piece of the traces.
    View(View),
    /// Throttle, 0 to 1, which holds for 200 ms; `signal` is a DShot's number in `INP_PROTO`.
    Throttle { esc: usize, value: f64, signal: u8 },
    /// End of the throttle signal.
    Silence { esc: usize },
    /// A PWM period edge by edge.
    Switching { esc: usize },
    /// The names of the motor and load that stand there.
    Standing { esc: usize },
    /// Another motor with its load and supply: a bench of the library.
    Fit { esc: usize, bench: String },
    /// A scenario's throttle and faults, as text, and what is expected of them. Throttle or silence from this page ends it.
    Scenario { esc: usize, text: String },
    /// A fault that begins now, by its keys as `--fault` takes them.
    Fault { esc: usize, keys: String },
    /// Repairs everything that was broken.
    Mend { esc: usize },
}

/// A piece of the traces: the latest `span_s`, or the one that ends at `to_s`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct View {
    /// Returned with the answer.
    pub(super) id: u32,
    pub(super) esc: usize,
    pub(super) to_s: Option<f64>,
    pub(super) span_s: f64,
    /// Most points: a longer piece is reduced to the least and greatest value of each column.
    pub(super) columns: usize,
    /// Channel numbers.
    pub(super) channels: Vec<usize>,
    /// Instead of the latest piece, the latest around a crossing.
    pub(super) trigger: Option<Trigger>,
    /// True to view what there was when this first became true, however much time passes.
    pub(super) hold: bool,
}

/// A channel crosses a level.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Trigger {
    pub(super) channel: usize,
    pub(super) level: f32,
    pub(super) rising: bool,
    /// Share of the piece before the crossing, 0 to 1.
    pub(super) before: f64,
    /// Crossings up to this time do not count.
    pub(super) after_s: f64,
}
