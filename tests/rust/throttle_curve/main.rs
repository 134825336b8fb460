//! Draws thrust and efficiency over the throttle, from the tables of `tests/scenarios/throttle-curve.toml`, as SVG and
//! PNG, and prints the table in `shared/README.md`:
//! `cargo run -p siskin-tests --example throttle-curve -- target target`

mod best;

use std::error::Error;
use std::f64::consts::TAU;
use std::path::Path;

use siskin_emulator::plot::chart::{Axis, Curve, Figure, Panel, draw};
use siskin_emulator::scenario::stand;

use best::Bench;

/// The scenario's bench.
const BENCH: &str = "quad-10-inch";

/// The tables, with what is drawn of each, and its column's head.
const DRIVES: [(&str, &str, &str); 3] = [
    ("weakened", "field-oriented", "field-oriented"),
    (
        "linear",
        "field-oriented, CTL_WEAKEN = 0",
        "with `CTL_WEAKEN` 0",
    ),
    ("six-step", "six-step", "six-step"),
];

/// Size of a panel.
const PANEL: (u32, u32) = (750, 700);

/// Points of the best efficiency.
const POINTS: u32 = 100;

/// A steady run.
struct Row {
    throttle: f64,
    rad_s: f64,
    bus_v: f64,
    bus_a: f64,
}

/// What is told of a speed: thrust and efficiency, in percent.
struct Told<'a> {
    bench: &'a Bench,
    best_rad_s: f64,
}

impl Told<'_> {
    fn thrust(&self, rad_s: f64) -> f64 {
        100.0 * (rad_s / self.best_rad_s).powi(2)
    }

    fn efficiency(&self, row: &Row) -> f64 {
        100.0 * self.bench.propeller_w(row.rad_s) / (row.bus_v * row.bus_a)
    }

    /// Returns the greatest efficiency over the thrust.
    fn best(&self) -> impl Iterator<Item = (f64, f64)> {
        let speeds =
            (1..=POINTS).map(|point| f64::from(point) / f64::from(POINTS) * self.best_rad_s);
        speeds.filter_map(|rad_s| {
            let share = self.bench.propeller_w(rad_s) / self.bench.least_w(rad_s)?;
            Some((self.thrust(rad_s), 100.0 * share))
        })
    }
}

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
        column("steady.bus_v_mean")?,
        column("steady.bus_a_mean")?,
    ];
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        let [throttle, rpm, bus_v, bus_a] = columns.map(|column| record[column].parse::<f64>());
        rows.push(Row {
            throttle: 100.0 * throttle?,
            rad_s: rpm? * TAU / 60.0,
            bus_v: bus_v?,
            bus_a: bus_a?,
        });
    }
    Ok(rows)
}

/// Prints every tenth of the throttle, and the best.
fn print(told: &Told, drives: &[Vec<Row>]) {
    let heads = |quantity: &str| DRIVES.map(|(.., head)| format!("{quantity}, {head} (%)"));
    let line = |cells: Vec<String>| println!("| {} |", cells.join(" | "));
    let heads: Vec<_> = [
        vec!["throttle (%)".to_owned()],
        heads("thrust").into(),
        heads("efficiency").into(),
    ]
    .concat();
    println!(
        "{}",
        heads
            .iter()
            .map(|head| format!("| {head} "))
            .collect::<String>()
            + "|"
    );
    println!("{}|", "|---".repeat(heads.len()));
    for (at, row) in drives[0].iter().enumerate() {
        if row.throttle.round() % 10.0 != 0.0 {
            continue;
        }
        let each = |of: &dyn Fn(&Row) -> f64| -> Vec<_> {
            drives
                .iter()
                .map(|rows| format!("{:.1}", of(&rows[at])))
                .collect()
        };
        let cells = [
            each(&|row| told.thrust(row.rad_s)),
            each(&|row| told.efficiency(row)),
        ]
        .concat();
        line([vec![format!("{:.0}", row.throttle)], cells].concat());
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<_> = std::env::args().collect();
    let [_, tables, folder] = words.as_slice() else {
        return Err("two words: the folder of the tables, and the one for the pictures".into());
    };
    let mut drives = Vec::new();
    for (file, ..) in DRIVES {
        drives.push(read(&Path::new(tables).join(file).with_extension("csv"))?);
    }
    let full = drives[0].last().ok_or("the first table is empty")?;
    let bench = Bench::new(&stand(BENCH, toml::Table::new())?, full);
    let best_rad_s = bench.best_rad_s();
    let told = Told {
        bench: &bench,
        best_rad_s,
    };
    print(&told, &drives);
    let curves = |point: &dyn Fn(&Row) -> (f64, f64)| -> Vec<_> {
        let curve = |((_, name, _), rows): (_, &Vec<Row>)| Curve {
            width: 4,
            ..Curve::line(name, rows.iter().map(point))
        };
        DRIVES.iter().copied().zip(&drives).map(curve).collect()
    };
    let best = |points: Vec<_>| Curve {
        width: 4,
        ..Curve::dashed("best possible", points)
    };
    let throttle = || Axis::new("throttle (%)");
    let efficiency = || Axis {
        range: Some((70.0, 100.0)),
        ..Axis::new("propeller over supply (%)")
    };
    let mut thrust = curves(&|row| (row.throttle, told.thrust(row.rad_s)));
    thrust.push(best(vec![(10.0, 100.0), (100.0, 100.0)]));
    let mut by_thrust = curves(&|row| (told.thrust(row.rad_s), told.efficiency(row)));
    by_thrust.push(best(told.best().collect()));
    let figure = Figure {
        name: "throttle-curve".to_owned(),
        title: format!(
            "A 10-inch propeller on 4S in voltage mode; the best possible is {:.0} rpm",
            best_rad_s * 60.0 / TAU
        ),
        columns: 3,
        panel: PANEL,
        panels: vec![
            Panel::new(
                "Thrust",
                throttle(),
                Axis::new("thrust, of the best possible (%)"),
                thrust,
            ),
            Panel::new(
                "Efficiency over the throttle",
                throttle(),
                efficiency(),
                curves(&|row| (row.throttle, told.efficiency(row))),
            ),
            Panel::new(
                "Efficiency over the thrust",
                Axis::new("thrust, of the best possible (%)"),
                efficiency(),
                by_thrust,
            ),
        ],
    };
    draw(&[figure], Path::new(folder))?;
    Ok(())
}
