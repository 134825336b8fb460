//! Checks the reference in `README.md` against the code: every key that a file can have, and no
//! other.

use serde::de::value::Error;
use serde::de::{Deserialize, Deserializer, Error as _, Visitor};
use serde::forward_to_deserialize_any;

const README: &str = include_str!("../README.md");

/// Collects the names of a struct's fields, or an enum's variants, from what serde derived for it.
struct Names<'a>(&'a mut Vec<&'static str>);

impl<'de> Deserializer<'de> for Names<'_> {
    type Error = Error;

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, Error> {
        self.0.extend(fields);
        Err(Error::custom("the names are all that is wanted"))
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, Error> {
        self.0.extend(variants);
        Err(Error::custom("the names are all that is wanted"))
    }

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(Error::custom("it is neither a struct nor an enum"))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit
        unit_struct newtype_struct seq tuple tuple_struct map identifier ignored_any
    }
}

/// Returns the rows of the table under a README heading, cell by cell.
pub(crate) fn rows(heading: &str) -> Vec<Vec<String>> {
    let (_, section) = README
        .split_once(&format!("\n### {heading}\n"))
        .unwrap_or_else(|| panic!("README.md has no heading {heading}"));
    let section = section.split("\n#").next().unwrap_or_default();
    let rows = section.lines().filter(|line| line.starts_with("| `"));
    rows.map(|row| {
        let row = row.replace("\\|", "or");
        let cells = row.trim_matches('|').split('|');
        cells.map(|cell| cell.trim().to_owned()).collect()
    })
    .collect()
}

/// Returns the text between a cell's backquotes, if that is all.
pub(crate) fn code(cell: &str) -> Option<&str> {
    cell.strip_prefix('`')?.strip_suffix('`')
}

/// Compares the first column of a table with these names, in order.
pub(crate) fn assert_lists(heading: &str, names: &[&str]) {
    let rows = rows(heading);
    let listed: Vec<_> = rows.iter().filter_map(|row| code(&row[0])).collect();
    assert_eq!(listed, names, "the table under {heading} in README.md");
}

/// Compares the first column of a table with the keys of a struct, or the words of an enum.
pub(crate) fn assert_has_all<'de, T: Deserialize<'de>>(heading: &str) {
    let mut names = Vec::new();
    // The names come with an error.
    let _ = T::deserialize(Names(&mut names));
    assert!(!names.is_empty());
    assert_lists(heading, &names);
}
