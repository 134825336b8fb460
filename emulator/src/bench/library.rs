//! Whole benches: the built-in ones, and files like them.
//!
//! A bench is the `[bench]` and `[params]` of a scenario: the hardware, and what the ESC must know of it. Motors and
//! loads in it that have a `name` are known by that name.

use std::path::Path;
use std::sync::LazyLock;

use serde::Deserialize;
use toml::{Table, Value};

use super::error::BenchError;
use super::text::toml_reason;
use super::word::word;

/// The built-in files; the first is the default.
const FILES: [(&str, &str); 16] = [
    ("bosso", include_str!("../../library/bosso.toml")),
    ("bosso-real", include_str!("../../library/bosso-real.toml")),
    ("bare", include_str!("../../library/bare.toml")),
    ("whoop", include_str!("../../library/whoop.toml")),
    (
        "quad-3-inch",
        include_str!("../../library/quad-3-inch.toml"),
    ),
    (
        "quad-5-inch",
        include_str!("../../library/quad-5-inch.toml"),
    ),
    (
        "quad-7-inch",
        include_str!("../../library/quad-7-inch.toml"),
    ),
    (
        "quad-10-inch",
        include_str!("../../library/quad-10-inch.toml"),
    ),
    (
        "quad-15-inch",
        include_str!("../../library/quad-15-inch.toml"),
    ),
    ("cinelifter", include_str!("../../library/cinelifter.toml")),
    (
        "lift-28-inch",
        include_str!("../../library/lift-28-inch.toml"),
    ),
    ("ducted-fan", include_str!("../../library/ducted-fan.toml")),
    ("helicopter", include_str!("../../library/helicopter.toml")),
    ("gimbal", include_str!("../../library/gimbal.toml")),
    ("skateboard", include_str!("../../library/skateboard.toml")),
    ("scooter", include_str!("../../library/scooter.toml")),
];

/// The bench used if none is named.
pub const DEFAULT: &str = FILES[0].0;

static TABLES: LazyLock<Vec<Table>> = LazyLock::new(|| {
    let table = |(_, text): &(&str, &str)| text.parse().expect("the built-in files are tested");
    FILES.iter().map(table).collect()
});

/// Returns the names of the built-in benches.
pub fn names() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|(name, _)| *name)
}

/// Returns true if one of the built-in benches sets this parameter.
pub fn sets(name: &str) -> bool {
    let params = TABLES.iter().filter_map(|table| table.get("params"));
    params
        .filter_map(Value::as_table)
        .any(|params| params.contains_key(name))
}

/// Says what is wrong with a bench file on its own, from its text and its tables.
pub type Check<'a> = &'a dyn Fn(&str, &Table) -> Result<(), String>;

/// Puts the bench named by `bench.base` under `root`, a scenario's tables: tables are merged key by key, everything
/// else in `root` stays. If none is named, only the default bench's `[params]` are added: its hardware is the default
/// already. Paths are relative to `folder`.
///
/// # Errors
/// A base that is neither built in nor a file, or is no bench.
pub fn complete(root: &mut Table, folder: &Path, check: Check) -> Result<(), BenchError> {
    begin_at(folder, root);
    let mut bench = root.get_mut("bench").and_then(Value::as_table_mut);
    let under = match bench.as_ref().and_then(|bench| bench.get("base")) {
        Some(Value::String(name)) => find(name, check)?,
        // If it is no text it is left to be refused with the rest.
        Some(_) => return Ok(()),
        None => {
            let mut default = TABLES[0].clone();
            default.retain(|key, _| key == "params");
            default
        }
    };
    if let Some(bench) = &mut bench {
        bench.remove("base");
    }
    merge(root, &under);
    Ok(())
}

/// Makes the paths in `[bench]` relative to a folder, if the file exists there.
fn begin_at(folder: &Path, root: &mut Table) {
    let Some(Value::Table(bench)) = root.get_mut("bench") else {
        return;
    };
    for (kind, value) in bench.iter_mut() {
        let Value::String(name) = value else {
            continue;
        };
        let built_in = match kind.as_str() {
            "base" => names().any(|known| known == name),
            "motor" | "load" => part_named(kind, name).is_some(),
            "bus" => word(name).is_some(),
            _ => true,
        };
        let path = folder.join(&*name);
        if let Some(path) = path.to_str()
            && !built_in
            && Path::new(path).is_file()
        {
            *name = path.to_owned();
        }
    }
}

/// Finds the tables of a bench by name or path.
fn find(name: &str, check: Check) -> Result<Table, BenchError> {
    if let Some(index) = names().position(|known| known == name) {
        return Ok(TABLES[index].clone());
    }
    let kind = "bench";
    if !Path::new(name).is_file() {
        return Err(BenchError::Unknown {
            kind,
            name: name.to_owned(),
            known: names().collect::<Vec<_>>().join(", "),
        });
    }
    let failed = |reason: String| BenchError::File {
        kind,
        path: name.to_owned(),
        reason,
    };
    let text = std::fs::read_to_string(name).map_err(|error| failed(error.to_string()))?;
    let table: Result<Table, _> = text.parse();
    let mut table = table.map_err(|error| failed(toml_reason(&text, &error)))?;
    let stranger = table
        .keys()
        .find(|key| !["bench", "params"].contains(&key.as_str()));
    if let Some(key) = stranger {
        return Err(failed(format!(
            "{key}: a bench has [bench] and [params] only"
        )));
    }
    for (key, problem) in [
        ("base", "a bench is built on no other"),
        ("seed", "a scenario's seed is its own"),
    ] {
        let bench = table.get("bench");
        if bench.and_then(|bench| bench.get(key)).is_some() {
            return Err(failed(format!("{key}: {problem}")));
        }
    }
    begin_at(
        Path::new(name).parent().unwrap_or(Path::new("")),
        &mut table,
    );
    check(&text, &table).map_err(failed)?;
    Ok(table)
}

/// Adds missing keys.
fn merge(over: &mut Table, under: &Table) {
    for (key, value) in under {
        match (over.get_mut(key), value) {
            (Some(Value::Table(over)), Value::Table(under)) => merge(over, under),
            (Some(_), _) => {}
            (None, value) => {
                over.insert(key.clone(), value.clone());
            }
        }
    }
}

/// Returns the motor or load of this name in the library.
pub(super) fn part<T: for<'de> Deserialize<'de>>(kind: &str, name: &str) -> Option<T> {
    T::deserialize(part_named(kind, name)?.clone()).ok()
}

fn part_named(kind: &str, name: &str) -> Option<&'static Value> {
    let mut parts = TABLES.iter().filter_map(|table| part_of(table, kind));
    parts.find(|part| part_name(part) == Some(name))
}

/// Returns the names of all motors or loads in the library.
pub(super) fn known(kind: &str) -> String {
    let parts = TABLES.iter().filter_map(|table| part_of(table, kind));
    let mut names: Vec<_> = parts.filter_map(part_name).collect();
    names.sort_unstable();
    names.dedup();
    names.join(", ")
}

fn part_of<'a>(table: &'a Table, kind: &str) -> Option<&'a Value> {
    table.get("bench")?.get(kind)
}

fn part_name(part: &Value) -> Option<&str> {
    part.get("name")?.as_str()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn completed(text: &str) -> Result<Table, BenchError> {
        let mut root: Table = text.parse().unwrap();
        complete(&mut root, Path::new(""), &|_, _| Ok(())).map(|()| root)
    }

    #[test]
    fn a_scenario_s_own_keys_stand_over_the_base_s() {
        let text =
            "[bench]\nbase = 'quad-10-inch'\nbus = 12.0\nmotor.R = 0.2\n[params]\nMOT_R_MOHM = 200";
        let root = completed(text).unwrap();
        let bench = &root["bench"];
        assert_eq!(bench["bus"].as_float(), Some(12.0));
        assert_eq!(bench["motor"]["R"].as_float(), Some(0.2));
        assert_eq!(bench["motor"]["pole_pairs"].as_integer(), Some(7));
        assert_eq!(bench["load"]["c2"].as_float(), Some(2.5e-7));
        assert!(bench.get("base").is_none());
        assert_eq!(root["params"]["MOT_R_MOHM"].as_integer(), Some(200));
        assert_eq!(root["params"]["MOT_POLE_PAIRS"].as_integer(), Some(7));
        // A name replaces the base's whole motor.
        let root = completed("[bench]\nbase = 'scooter'\nmotor = 'x'").unwrap();
        assert_eq!(root["bench"]["motor"].as_str(), Some("x"));
    }

    #[test]
    fn what_is_no_bench_is_named() {
        let error = completed("[bench]\nbase = 'tricycle'")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("tricycle") && error.contains("scooter"),
            "{error}"
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.toml");
        for (text, word) in [
            ("[bench", "line 1"),
            ("[[signal]]\nat_s = 0.0", "signal"),
            ("[bench]\nbase = 'bosso'", "base"),
            ("[bench]\nseed = 3", "seed"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = completed(&format!("[bench]\nbase = {path:?}")).unwrap_err();
            let error = error.to_string();
            assert!(
                error.contains("mine.toml") && error.contains(word),
                "{error}"
            );
        }
    }

    #[test]
    fn the_readme_has_every_bench() {
        let readme = include_str!("../../README.md");
        for name in names() {
            assert!(readme.contains(&format!("`{name}`")), "{name}");
        }
    }
}
