//! The runs that a scenario with `[sweep]` and `[random]` stands for: every combination of the
//! swept values, each for every seed.
//!
//! Values are put into the file's tables before these are parsed, so that any key of the file can
//! be varied. A draw depends on the seed and on its key alone: what else is swept, drawn or set
//! does not change it.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};
use toml::{Table, Value};
use xxhash_rust::xxh3::xxh3_64_with_seed;

use super::error::ScenarioError;
use super::file::{BenchTable, Draw, Scenario};
use super::lines::reason;
use super::place::Place;
use crate::plant::share_of;

/// Most runs at once: at a second of simulation each, some ten minutes.
const RUNS_MAX: u128 = 100_000;

/// The file with what varies.
#[derive(Debug)]
pub(super) struct Variations {
    /// The file's tables without what varies.
    base: Table,
    /// Swept keys; those set on the command line come last, with one value.
    swept: Vec<(String, Vec<Value>)>,
    drawn: Vec<(String, Draw)>,
    /// The command line's seeds.
    seeds: Option<RangeInclusive<u64>>,
    runs: usize,
    /// The folder to which its paths are relative.
    folder: PathBuf,
}

/// One run.
#[derive(Debug)]
pub(super) struct Case {
    /// What identifies it.
    pub(super) place: Place,
    /// What is played.
    pub(super) scenario: Scenario,
}

impl Variations {
    /// Reads a scenario of this folder; `set` are keys given one value on the command line.
    pub(super) fn read(
        text: &str,
        set: &[(String, Value)],
        seeds: Option<RangeInclusive<u64>>,
        folder: &Path,
    ) -> Result<Self, ScenarioError> {
        let syntax = |error: &toml::de::Error| ScenarioError::Syntax(reason(text, error));
        let mut base = toml::from_str::<Table>(text).map_err(|error| syntax(&error))?;
        let scenario = match toml::from_str::<Scenario>(text) {
            Ok(scenario) => scenario,
            // What a table omits may be in the base's. An error that both have has a line.
            Err(error) => {
                let message = error.message().replace('\n', " ");
                let whole = Scenario::read(base.clone(), folder);
                whole.map_err(|whole| match &whole {
                    ScenarioError::Syntax(said) if *said == message => syntax(&error),
                    _ => whole,
                })?
            }
        };
        base.remove("sweep");
        base.remove("random");

        let given = |key: &String| set.iter().any(|(other, _)| other == key);
        let mut swept: Vec<_> = scenario.sweep.into_iter().collect();
        swept.retain(|(key, _)| !given(key));
        swept.extend(
            set.iter()
                .map(|(key, value)| (key.clone(), vec![value.clone()])),
        );
        let mut drawn: Vec<_> = scenario.random.into_iter().collect();
        drawn.retain(|(key, _)| !given(key));
        for (key, draw) in &drawn {
            let problem = if swept.iter().any(|(other, _)| other == key) {
                Some("is both swept and drawn")
            } else if key == "bench.seed" {
                Some("the seed makes the draws and cannot be one")
            } else {
                draw.problem()
            };
            if let Some(problem) = problem {
                return Err(ScenarioError::of_key(key, problem));
            }
        }
        if let Some((key, _)) = swept.iter().find(|(_, values)| values.is_empty()) {
            return Err(ScenarioError::of_key(key, "no values"));
        }

        let seed_count = seeds.as_ref().map_or(1, |seeds| {
            u128::from(*seeds.end()).saturating_sub(u128::from(*seeds.start())) + 1
        });
        let runs = swept.iter().fold(seed_count, |runs, (_, values)| {
            runs.saturating_mul(values.len() as u128)
        });
        if runs > RUNS_MAX {
            return Err(ScenarioError::Runs {
                runs,
                most: RUNS_MAX,
            });
        }
        let variations = Self {
            base,
            swept,
            drawn,
            seeds,
            runs: runs as usize,
            folder: folder.to_owned(),
        };
        variations.check_keys()?;
        Ok(variations)
    }

    /// Returns the number of runs.
    pub(super) fn runs(&self) -> usize {
        self.runs
    }

    /// Returns the run of an index below [`Self::runs`]: the seeds change fastest, then the last
    /// swept key.
    pub(super) fn case(&self, index: usize) -> Result<Case, ScenarioError> {
        let mut rest = index as u64;
        let seed_of_line = self.seeds.as_ref().map(|seeds| {
            let count = seeds.end() - seeds.start() + 1;
            let seed = seeds.start() + rest % count;
            rest /= count;
            seed
        });
        let mut set = Vec::new();
        for (key, values) in self.swept.iter().rev() {
            let count = values.len() as u64;
            set.push((key.clone(), values[(rest % count) as usize].clone()));
            rest /= count;
        }
        set.reverse();

        let mut root = Value::Table(self.base.clone());
        for (key, value) in &set {
            put(&mut root, key, value.clone())?;
        }
        let seed = seed_of_line.or_else(|| seed(&root));
        let seed = seed.unwrap_or(BenchTable::default().seed);
        let mut drawn = Vec::new();
        for (key, draw) in &self.drawn {
            let value = draw.value(key, seed);
            put(&mut root, key, value.clone())?;
            drawn.push((key.clone(), value));
        }
        let place = Place { seed, set, drawn };
        let mut scenario = self.understand(root).map_err(|error| place.blame(error))?;
        scenario.bench.seed = seed;
        Ok(Case { place, scenario })
    }

    /// Reads the scenario from a root that is still a table after [`put`].
    fn understand(&self, root: Value) -> Result<Scenario, ScenarioError> {
        Scenario::read(Table::try_from(root).unwrap_or_default(), &self.folder)
    }

    /// Puts every value in alone, so that an error names the key of the value that does not fit.
    fn check_keys(&self) -> Result<(), ScenarioError> {
        let swept = self.swept.iter();
        let swept = swept.flat_map(|(key, values)| values.iter().map(move |value| (key, value)));
        for (key, value) in swept {
            self.check(key, value.clone())?;
        }
        for (key, draw) in &self.drawn {
            match draw {
                Draw::Whole(ends) => ends.iter().try_for_each(|x| self.check(key, (*x).into())),
                Draw::Real(ends) => ends.iter().try_for_each(|x| self.check(key, (*x).into())),
                Draw::OneOf { of } => of.iter().try_for_each(|x| self.check(key, x.clone())),
            }?;
        }
        Ok(())
    }

    fn check(&self, key: &str, value: Value) -> Result<(), ScenarioError> {
        let mut root = Value::Table(self.base.clone());
        put(&mut root, key, value)?;
        match self.understand(root) {
            Ok(_) => Ok(()),
            Err(error) => Err(ScenarioError::of_key(key, error.to_string())),
        }
    }
}

impl Draw {
    fn problem(&self) -> Option<&'static str> {
        match self {
            Self::Whole([least, greatest]) if least > greatest => {
                Some("the least value is greater")
            }
            Self::Real([least, greatest]) if !(greatest - least).is_finite() => {
                Some("give two finite numbers")
            }
            Self::Real([least, greatest]) if least > greatest => Some("the least value is greater"),
            Self::OneOf { of } if of.is_empty() => Some("no values"),
            _ => None,
        }
    }

    /// Returns the value of a key for a seed.
    fn value(&self, key: &str, seed: u64) -> Value {
        let seed = xxh3_64_with_seed(key.as_bytes(), seed);
        let bits = Xoshiro256PlusPlus::seed_from_u64(seed).next_u64();
        // The product's upper half is uniform over 0..count to the precision of 64 bits.
        let below = |count: u128| (u128::from(bits).saturating_mul(count)) >> 64;
        match self {
            Self::Whole([least, greatest]) => {
                let count = u128::from(greatest.abs_diff(*least)) + 1;
                Value::Integer(least.saturating_add_unsigned(below(count) as u64))
            }
            Self::Real([least, greatest]) => {
                Value::Float(least + share_of(bits) * (greatest - least))
            }
            Self::OneOf { of } => of[below(of.len() as u128) as usize].clone(),
        }
    }
}

/// Puts a value where a dotted key points; array entries count from 0.
fn put(root: &mut Value, key: &str, value: Value) -> Result<(), ScenarioError> {
    let mut place = root;
    for part in key.split('.') {
        place = match place {
            Value::Table(table) => table
                .entry(part)
                .or_insert_with(|| Value::Table(Table::new())),
            Value::Array(list) => {
                let count = list.len();
                let entry = part.parse().ok().and_then(|i: usize| list.get_mut(i));
                entry.ok_or_else(|| {
                    ScenarioError::of_key(
                        key,
                        format!("{part} is none of its {count} entries, from 0"),
                    )
                })?
            }
            other => {
                let kind = other.type_str();
                return Err(ScenarioError::of_key(
                    key,
                    format!("a {kind} has no {part} in it"),
                ));
            }
        };
    }
    *place = value;
    Ok(())
}

/// Returns the seed of the file.
fn seed(root: &Value) -> Option<u64> {
    root.get("bench")?
        .get("seed")?
        .as_integer()?
        .try_into()
        .ok()
}

#[cfg(test)]
mod tests;
