//! The figure: a title, the drive's phases, and panels over a common time.

use plotters::backend::DrawingBackend;
use plotters::element::Rectangle;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, WHITE};
use siskin_control::drive::Fault;

use super::canvas::{Area, Drawn, Picture};
use super::page::{LEFT, RIGHT, WIDTH, legend};
use super::panel::{Curve, Look, Panel};
use super::phases::{name, spans, tint};
use super::read::Recording;
use super::style::{BLUE, FAULT, GREEN, GREY, GRID, ORANGE, VERMILION, heading, number, text};

const HEIGHT: u32 = 2100;
/// Columns that a recording is reduced to: one for about two and a half pixels, so that the SVG of
/// a long recording stays below 300 kB.
pub(super) const COLUMNS: usize = 900;
const TITLE: u32 = 90;
const STRIP: u32 = 44;

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
