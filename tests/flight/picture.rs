//! Draws a flight recorded by `tests/flight/fly.py --record`, as SVG and PNG:
//! `cargo run -p siskin-tests --example flight-picture -- target/flight.csv target` draws `target/flight.svg`.

use std::error::Error;
use std::path::Path;

use plotters::style::RGBColor;
use siskin_emulator::plot::chart::{Axis, Curve, Figure, Panel, Stretch, draw};

/// Most points of a curve, each the mean of the rows up to the next one.
const POINTS: usize = 1000;

/// Size of a panel.
const PANEL: (u32, u32) = (2400, 480);

/// Lasting events, with their background colour.
const EVENTS: [(&str, RGBColor); 9] = [
    ("climb", RGBColor(0xdf, 0xef, 0xfa)),
    ("hover", RGBColor(0xe9, 0xf6, 0xf0)),
    ("roll", RGBColor(0xfd, 0xf1, 0xcf)),
    ("gust", RGBColor(0xf8, 0xe8, 0xf1)),
    ("weak pack", RGBColor(0xf9, 0xe4, 0xd8)),
    ("descent", RGBColor(0xdf, 0xef, 0xfa)),
    ("punch", RGBColor(0xfd, 0xf1, 0xcf)),
    ("disarmed", RGBColor(0xf8, 0xe8, 0xf1)),
    ("sag", RGBColor(0xf9, 0xe4, 0xd8)),
];

/// A flight by rows: time first, the event last.
struct Flight {
    /// The record's, and the picture's.
    name: String,
    heads: csv::StringRecord,
    rows: Vec<Vec<f64>>,
    events: Vec<String>,
}

impl Flight {
    fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let mut reader = csv::Reader::from_path(path)?;
        let heads = reader.headers()?.clone();
        let (mut rows, mut events) = (Vec::new(), Vec::new());
        for record in reader.records() {
            let record = record?;
            let numbers = record.iter().take(heads.len() - 1).map(str::parse);
            rows.push(numbers.collect::<Result<_, _>>()?);
            events.push(record[heads.len() - 1].to_owned());
        }
        let name = path.file_stem().unwrap_or_default();
        Ok(Self {
            name: name.to_string_lossy().into_owned(),
            heads,
            rows,
            events,
        })
    }

    fn column(&self, head: &str) -> usize {
        let column = self.heads.iter().position(|each| each == head);
        column.unwrap_or_else(|| panic!("no column {head}"))
    }

    fn curve(&self, name: &str, head: &str) -> Curve {
        let column = self.column(head);
        let mean = |rows: &[Vec<f64>], column: usize| {
            rows.iter().map(|row| row[column]).sum::<f64>() / rows.len() as f64
        };
        let chunks = self.rows.chunks(self.rows.len().div_ceil(POINTS));
        let points = chunks.map(|rows| (mean(rows, 0), mean(rows, column)));
        Curve {
            width: 4,
            ..Curve::line(name, points)
        }
    }

    /// Returns each event from its first row to the one after its last.
    fn stretches(&self) -> Vec<(&str, f64, f64)> {
        let mut begin = 0;
        let chunks = self.events.chunk_by(|a, b| a == b);
        let stretches = chunks.map(|chunk| {
            let end = begin + chunk.len();
            let last = &self.rows[end.min(self.rows.len() - 1)];
            let stretch = (chunk[0].as_str(), self.rows[begin][0], last[0]);
            begin = end;
            stretch
        });
        stretches.collect()
    }

    fn panel(&self, title: &str, axis: &str, first: bool, curves: Vec<Curve>) -> Panel {
        let stretches = self.stretches();
        let tinted = stretches.iter().filter_map(|(event, t0_s, t1_s)| {
            let (name, tint) = EVENTS.iter().find(|(name, _)| name == event)?;
            Some(Stretch {
                name: if first { name } else { "" },
                ends: (*t0_s, *t1_s),
                tint: *tint,
            })
        });
        let breaks = self.column("breaks");
        let broken = self
            .rows
            .windows(2)
            .filter(|pair| pair[0][breaks] < pair[1][breaks]);
        Panel {
            stretches: tinted.collect(),
            faults: broken.map(|pair| pair[1][0]).collect(),
            ..Panel::new(title, Axis::new("time (s)"), Axis::new(axis), curves)
        }
    }

    fn figure(&self) -> Figure {
        let breaks = self.column("breaks");
        let lines = if self.rows.iter().any(|row| row[breaks] > 0.0) {
            "; lines: a propeller strikes, an ESC's wire is silent for 50 ms"
        } else {
            ""
        };
        let speeds = ["rear right", "front right", "rear left", "front left"];
        let speeds = speeds.iter().zip(["rpm_1", "rpm_2", "rpm_3", "rpm_4"]);
        let speeds = speeds.map(|(name, head)| self.curve(name, head));
        let angles = vec![
            self.curve("roll", "roll_deg"),
            self.curve("pitch", "pitch_deg"),
        ];
        Figure {
            name: self.name.clone(),
            title: format!("Betaflight flies on four emulated ESCs{lines}"),
            columns: 1,
            panel: PANEL,
            panels: vec![
                self.panel(
                    "Height",
                    "height (m)",
                    true,
                    vec![self.curve("height", "height_m")],
                ),
                self.panel("Attitude", "angle (°)", false, angles),
                self.panel("Propellers", "speed (rpm)", false, speeds.collect()),
                self.panel(
                    "Pack",
                    "voltage (V)",
                    false,
                    vec![self.curve("under load", "supply_v")],
                ),
            ],
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<_> = std::env::args().collect();
    let [_, record, folder] = words.as_slice() else {
        return Err("two words: the record of a flight, and the folder for the pictures".into());
    };
    draw(
        &[Flight::read(Path::new(record))?.figure()],
        Path::new(folder),
    )?;
    Ok(())
}
