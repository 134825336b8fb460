//! Draws thrust and efficiency over the throttle, from the tables of `tests/scenarios/throttle-curve.toml`, as SVG and
//! PNG: `cargo run -p siskin-tests --example throttle-curve -- target/curve target`

use std::error::Error;
use std::path::Path;

use siskin_emulator::plot::chart::{Axis, Curve, Figure, Panel, draw};

/// The tables, with what is drawn of each.
const DRIVES: [(&str, &str); 3] = [
    (
        "weakened",
        "field-oriented, the whole supply and flux weakening",
    ),
    ("linear", "field-oriented, CTL_WEAKEN = 0"),
    ("six-step", "six-step"),
];

/// Size of a panel.
const PANEL: (u32, u32) = (1200, 800);

/// Throttle, speed and efficiency.
type Row = (f64, f64, f64);

fn read(path: &Path) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut reader = csv::Reader::from_path(path)?;
    let heads = reader.headers()?.clone();
    let column = |head: &str| {
        let found = heads.iter().position(|each| each == head);
        found.ok_or_else(|| format!("{}: no column {head}", path.display()))
    };
    let columns = [
        column("signal.1.throttle")?,
        column("steady.rpm_mean")?,
        column("steady.efficiency")?,
    ];
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        let [throttle, rpm, efficiency] = columns.map(|column| record[column].parse::<f64>());
        rows.push((throttle?, rpm?, efficiency?));
    }
    Ok(rows)
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<_> = std::env::args().collect();
    let [_, tables, folder] = words.as_slice() else {
        return Err("two words: the folder of the tables, and the one for the pictures".into());
    };
    let mut drives = Vec::new();
    for (file, name) in DRIVES {
        drives.push((
            name,
            read(&Path::new(tables).join(file).with_extension("csv"))?,
        ));
    }
    let fastest = drives.iter().flat_map(|(_, rows)| rows).map(|row| row.1);
    let fastest = fastest.fold(0.0, f64::max);
    let curves = |y: &dyn Fn(&Row) -> f64| {
        let curve = |(name, rows): &(&str, Vec<Row>)| {
            let points = rows.iter().map(|row| (100.0 * row.0, 100.0 * y(row)));
            Curve {
                width: 4,
                ..Curve::line(*name, points)
            }
        };
        drives.iter().map(curve).collect::<Vec<_>>()
    };
    let panel = |title: &str, axis: &str, curves| {
        Panel::new(title, Axis::new("throttle (%)"), Axis::new(axis), curves)
    };
    let figure = Figure {
        name: "throttle-curve".to_owned(),
        title: "A 10-inch propeller on 4S in voltage mode".to_owned(),
        columns: 2,
        panel: PANEL,
        panels: vec![
            panel(
                "Thrust, as the square of the speed",
                "of the greatest (%)",
                curves(&|row| (row.1 / fastest).powi(2)),
            ),
            panel(
                "Efficiency, shaft over supply",
                "efficiency (%)",
                curves(&|row| row.2),
            ),
        ],
    };
    draw(&[figure], Path::new(folder))?;
    Ok(())
}
