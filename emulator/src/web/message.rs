//! What the page and the program say to each other over the socket.
//!
//! Text is JSON. Binary begins with a byte that says what it is: [`siskin_scope::MAVLINK`] frames, in both
//! directions, or a [`TRACE`], an answer to [`FromPage::View`].

use serde::Deserialize;

/// A piece of the traces follows.
pub(super) const TRACE: u8 = 1;

/// What the page asks for. `esc` counts from 0.
#[derive(Debug, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(super) enum FromPage {
    /// A piece of the traces.
    View(View),
    /// Throttle, 0 to 1, which holds for 200 ms; `signal` is the number of a DShot as `INP_PROTO` has it.
    Throttle { esc: usize, value: f64, signal: u8 },
    /// No throttle signal any more.
    Silence { esc: usize },
    /// A period of the PWM edge by edge.
    Switching { esc: usize },
    /// Another motor with its load and supply: a bench of the library.
    Fit { esc: usize, bench: String },
    /// A scenario's throttle and faults, by its text. Throttle or silence from this page ends it.
    Scenario { esc: usize, text: String },
    /// A fault that begins now, by its keys as `--fault` takes them.
    Fault { esc: usize, keys: String },
    /// All that was broken is whole again.
    Mend { esc: usize },
}

/// A piece of the traces: the latest `span_s`, or the one that ends at `to_s`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct View {
    /// Comes back with the answer.
    pub(super) id: u32,
    pub(super) esc: usize,
    pub(super) to_s: Option<f64>,
    pub(super) span_s: f64,
    /// The most points: a longer piece is told by the least and the greatest value of each column.
    pub(super) columns: usize,
    /// Numbers of channels.
    pub(super) channels: Vec<usize>,
    /// In place of the latest: the latest piece around a crossing.
    pub(super) trigger: Option<Trigger>,
    /// True to look at what there was when this was first true, however much time passes.
    pub(super) hold: bool,
}

/// A channel crosses a level.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Trigger {
    pub(super) channel: usize,
    pub(super) level: f32,
    pub(super) rising: bool,
    /// What of the piece is before the crossing, 0 to 1.
    pub(super) before: f64,
    /// Crossings up to here do not count.
    pub(super) after_s: f64,
}
