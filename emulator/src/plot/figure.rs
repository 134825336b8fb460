//! The figure: a title, the drive's phases, and panels over a common time.

use plotters::backend::DrawingBackend;
use plotters::element::Rectangle;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBAColor, RGBColor, WHITE};
use siskin_control::drive::{Fault, Phase};

use super::canvas::{Area, Drawn, Picture};
use super::panel::{Curve, Look, Panel};
use super::read::Recording;
use super::style::{BLUE, FAULT, GREEN, GREY, GRID, ORANGE, VERMILION, heading, number, text};

const WIDTH: u32 = 2400;
const HEIGHT: u32 = 2100;
/// Columns that a recording is reduced to: one for about two and a half pixels, so that the SVG of
/// a long recording stays below 300 kB.
pub(super) const COLUMNS: usize = 900;
/// Left of the axes.
pub(super) const LEFT: u32 = 150;
/// Right of the axes.
pub(super) const RIGHT: u32 = 40;
const TITLE: u32 = 90;
const STRIP: u32 = 44;

/// A stretch of time in one phase.
pub(super) struct Span {
    pub(super) phase: Phase,
    pub(super) t0_s: f64,
    pub(super) t1_s: f64,
}

impl Picture for Recording {
    fn size(&self) -> (u32, u32) {
        (WIDTH, HEIGHT)
    }

    fn draw<B: DrawingBackend>(&self, root: &Area<B>) -> Drawn<B> {
        draw(root, self)
    }
}

fn draw<B: DrawingBackend>(root: &Area<B>, recording: &Recording) -> Drawn<B> {
    root.fill(&WHITE)?;
    title(root, recording)?;
    strip(root, recording)?;

    let line = |name, trace, colour, width| Curve {
        name,
        trace,
        colour,
        look: Look::Line(width),
    };
    let spread = |name, trace, colour| Curve {
        name,
        trace,
        colour,
        look: Look::Spread(3),
    };
    let r = recording;
    let panels = [
        (
            30,
            Panel {
                title: "Speed",
                axis: "speed (rpm)",
                curves: &[
                    line("reference", &r.rpm_ref, GREY, 7),
                    line("true", &r.rpm, BLUE, 5),
                    line("estimated", &r.rpm_est, ORANGE, 3),
                ],
                outliers: 0.0,
                least_span: 10.0,
                time: false,
            },
        ),
        (
            27,
            Panel {
                title: "Currents",
                axis: "current (A)",
                curves: &[
                    Curve {
                        name: "phase a",
                        trace: &r.i_a_a,
                        colour: GREY,
                        look: Look::Band,
                    },
                    spread("i_d", &r.i_d_a, BLUE),
                    spread("i_q", &r.i_q_a, VERMILION),
                ],
                outliers: 0.0,
                least_span: 0.5,
                time: false,
            },
        ),
        (
            22,
            Panel {
                title: "Voltages",
                axis: "voltage (V)",
                curves: &[
                    line("bus/√3", &r.u_max_v, GREY, 4),
                    spread("u_d", &r.u_d_v, BLUE),
                    spread("u_q", &r.u_q_v, VERMILION),
                ],
                outliers: 0.0,
                least_span: 0.5,
                time: false,
            },
        ),
        (
            21,
            Panel {
                title: "Angle error: estimated less true, while the observer leads",
                axis: "error (el. °)",
                curves: &[spread("angle error", &r.angle_error_deg, GREEN)],
                // The first periods of the observer may be far off, and would flatten the rest.
                outliers: 0.005,
                least_span: 1.0,
                time: true,
            },
        ),
    ];
    let margins: u32 = panels
        .iter()
        .map(|(_, panel)| Panel::margins(panel.time))
        .sum();
    let shares: u32 = panels.iter().map(|(share, _)| share).sum();
    let axes = HEIGHT - TITLE - STRIP - margins - 20;
    let mut rest = root.margin(TITLE + STRIP, 0, 0, 0);
    for (share, panel) in &panels {
        let height = axes * share / shares + Panel::margins(panel.time);
        let (area, below) = rest.split_vertically(height);
        panel.draw(&area, recording)?;
        rest = below;
    }
    Ok(())
}

fn title<B: DrawingBackend>(root: &Area<B>, recording: &Recording) -> Drawn<B> {
    let length_s = recording.t1_s - recording.t0_s;
    let rate_khz = recording.periods as f64 / length_s / 1e3;
    let length = number(length_s);
    let text = format!("{}: {length} s at {rate_khz:.1} kHz", recording.name);
    let middle = TITLE as i32 / 2;
    root.draw_text(&text, &heading(38.0), (LEFT as i32, middle))?;
    let bits = recording.faults.iter().fold(0, |all, bits| all | bits);
    let faults = Fault::ALL
        .iter()
        .filter(|fault| bits & 1 << **fault as u8 != 0);
    let faults: Vec<_> = faults.map(|fault| fault.text()).collect();
    if faults.is_empty() {
        return Ok(());
    }
    let text = format!("fault: {}", faults.join(", "));
    legend(root, middle, [(text.as_str(), FAULT.mix(1.0), 5)])
}

/// The names of the phases over their stretches.
fn strip<B: DrawingBackend>(root: &Area<B>, recording: &Recording) -> Drawn<B> {
    let (top, bottom) = (TITLE as i32, (TITLE + STRIP) as i32);
    let width = f64::from(WIDTH - LEFT - RIGHT);
    let length_s = recording.t1_s - recording.t0_s;
    let x = |t_s: f64| LEFT as i32 + ((t_s - recording.t0_s) / length_s * width) as i32;
    let style = text(26.0);
    for span in spans(recording) {
        let (left, right) = (x(span.t0_s), x(span.t1_s));
        let tint = tint(span.phase).unwrap_or(WHITE);
        let corners = [(left, top), (right, bottom)];
        root.draw(&Rectangle::new(corners, tint.filled()))?;
        root.draw(&Rectangle::new(corners, GRID.stroke_width(2)))?;
        let name = name(span.phase);
        let room = root.estimate_text_size(name, &style)?.0 as i32 + 12;
        if right - left >= room {
            let style = style.pos(Pos::new(HPos::Center, VPos::Center));
            root.draw_text(name, &style, ((left + right) / 2, (top + bottom) / 2))?;
        }
    }
    Ok(())
}

/// A line of legend that ends at the right of the axes: names, colours, thickness of the samples.
pub(super) fn legend<'a, B: DrawingBackend>(
    area: &Area<B>,
    middle: i32,
    entries: impl IntoIterator<Item = (&'a str, RGBAColor, i32), IntoIter: DoubleEndedIterator>,
) -> Drawn<B> {
    let style = text(26.0);
    let mut right = (WIDTH - RIGHT) as i32;
    for (name, colour, thickness) in entries.into_iter().rev() {
        let left = right - area.estimate_text_size(name, &style)?.0 as i32;
        area.draw_text(name, &style, (left, middle))?;
        let corners = [
            (left - 64, middle - thickness / 2),
            (left - 14, middle + (thickness + 1) / 2),
        ];
        area.draw(&Rectangle::new(corners, colour.filled()))?;
        right = left - 100;
    }
    Ok(())
}

/// The stretches of the drive's phases.
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

/// Where a fault begins, s.
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

/// The background of a phase; none where nothing happens.
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

fn name(phase: Phase) -> &'static str {
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
