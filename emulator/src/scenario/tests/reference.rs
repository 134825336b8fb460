//! The README's reference of a scenario's keys, and its defaults.

use crate::reference::{assert_has_all, code, rows};
use crate::scenario::file::{BenchTable, Expectation, Factors, Scenario, WindowTable};
use crate::scenario::signal::{Shape, Signal};

#[test]
fn the_reference_has_every_key() {
    assert_has_all::<Scenario>("The file");
    assert_has_all::<BenchTable>("`[bench]`");
    assert_has_all::<Factors>("`[bench.scale]`");
    assert_has_all::<Signal>("`[[signal]]`");
    assert_has_all::<Shape>("Shapes of a signal");
    assert_has_all::<WindowTable>("`[[window]]`");
    assert_has_all::<Expectation>("`[[expect]]`");
}

/// Returns the keys of a table with their defaults, as in a file.
fn defaults(heading: &str) -> String {
    let rows = rows(heading);
    let given = rows.iter().filter_map(|row| {
        let key = code(&row[0])?;
        Some(format!("{key} = {}\n", code(&row[1])?))
    });
    given.collect()
}

#[test]
fn the_defaults_of_the_bench_are_those_in_force() {
    let listed: BenchTable = toml::from_str(&defaults("`[bench]`")).unwrap();
    // A constant supply is the same as a number and as its text.
    let bench = |table: &BenchTable| table.bench().unwrap();
    assert_eq!(bench(&listed), bench(&BenchTable::default()));
    assert_eq!(listed.wire, BenchTable::default().wire);
    assert_eq!(listed.duration_s, BenchTable::default().duration_s);
    let factors: Factors = toml::from_str(&defaults("`[bench.scale]`")).unwrap();
    assert_eq!(factors, Factors::default());
}

#[test]
fn the_defaults_of_a_signal_are_those_in_force() {
    let signal = |keys: &str| toml::from_str::<Signal>(&format!("at_s = 1.0\n{keys}")).unwrap();
    let listed = signal(&defaults("`[[signal]]`"));
    assert_eq!(format!("{listed:?}"), format!("{:?}", signal("")));
}
