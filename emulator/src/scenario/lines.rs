//! Finds keys in a scenario's file.

use std::ops::Range;

use toml::de::{DeTable, DeValue};
use toml::{Spanned, Value};

use crate::bench::line_of_byte;

/// Returns the line on which a dotted key gets its value: where it is swept or drawn, or else its
/// own, or that of its would-be parent. `None` if the command line sets it, or no part of it
/// exists.
pub(super) fn line_of(text: &str, key: &str, set: &[(String, Value)]) -> Option<usize> {
    if set.iter().any(|(other, _)| other == key) {
        return None;
    }
    let root = DeTable::parse(text).ok()?;
    let varied = ["sweep", "random"].into_iter().find_map(|table| {
        let DeValue::Table(keys) = entry(root.get_ref(), table)?.1.get_ref() else {
            return None;
        };
        Some(entry(keys, key)?.0)
    });
    let span = varied.or_else(|| own(root.get_ref(), key))?;
    Some(line_of_byte(text, span.start))
}

/// Returns the dotted key whose entry holds this byte of the text.
fn key_at(text: &str, at: usize) -> Option<String> {
    let root = DeTable::parse(text).ok()?;
    holder(&DeValue::Table(root.into_inner()), at)
}

/// Says what is wrong with a text that is no scenario, with line and key.
pub(super) fn reason(text: &str, error: &toml::de::Error) -> String {
    let message = error.message().replace('\n', " ");
    let Some(span) = error.span() else {
        return message;
    };
    let line = line_of_byte(text, span.start);
    match key_at(text, span.start) {
        Some(key) => format!("line {line}: {key}: {message}"),
        None => format!("line {line}: {message}"),
    }
}

fn entry<'a, 'i>(
    table: &'a DeTable<'i>,
    name: &str,
) -> Option<(Range<usize>, &'a Spanned<DeValue<'i>>)> {
    let mut entries = table.iter();
    let (key, value) = entries.find(|(key, _)| *key.get_ref() == name)?;
    Some((key.span(), value))
}

/// Returns the place of the longest existing part of a dotted key; array entries count from 0.
fn own(root: &DeTable<'_>, key: &str) -> Option<Range<usize>> {
    let mut parts = key.split('.');
    let (mut span, mut place) = entry(root, parts.next()?)?;
    for part in parts {
        let next = match place.get_ref() {
            DeValue::Table(table) => entry(table, part),
            DeValue::Array(list) => {
                let value = part.parse().ok().and_then(|index: usize| list.get(index));
                value.map(|value| (value.span(), value))
            }
            _ => None,
        };
        match next {
            Some(next) => (span, place) = next,
            None => break,
        }
    }
    Some(span)
}

fn holder(value: &DeValue<'_>, at: usize) -> Option<String> {
    let within = |name: String, key: Range<usize>, value: &Spanned<DeValue<'_>>| {
        if let Some(inner) = holder(value.get_ref(), at) {
            return Some(format!("{name}.{inner}"));
        }
        // The span of a table may be that of its header alone.
        let is_leaf = !matches!(value.get_ref(), DeValue::Table(_) | DeValue::Array(_));
        let holds = key.contains(&at) || is_leaf && value.span().contains(&at);
        (holds || value.span().start == at).then_some(name)
    };
    match value {
        DeValue::Table(table) => table
            .iter()
            .find_map(|(key, value)| within(key.get_ref().to_string(), key.span(), value)),
        DeValue::Array(list) => list
            .iter()
            .enumerate()
            .find_map(|(index, value)| within(index.to_string(), value.span(), value)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = r#"[bench]
scale = { R = 1.0,
          L = 2.0 }
offset_a = [0.0, 0.0,
            9e9]

[[signal]]
at_s = 0.0
rpm = 1.0

[[signal]]
at_s = 1.0
rpm = 2.0
[sweep]
"signal.1.rpm" = [3.0]
[random]
"bench.noise_a" = [0.0, 1.0]
"#;

    #[test]
    fn a_key_has_a_line() {
        let line = |key| line_of(FILE, key, &[]);
        assert_eq!(line("bench"), Some(1));
        assert_eq!(line("bench.scale.L"), Some(3));
        assert_eq!(line("bench.offset_a.2"), Some(5));
        assert_eq!(line("signal.0.rpm"), Some(9));
        assert_eq!(line("signal.1.at_s"), Some(12));
        // A missing key has the line of its would-be parent.
        assert_eq!(line("bench.scale.J"), Some(2));
        assert_eq!(line("signal.1.throttle"), Some(11));
        // Where a key gets its value.
        assert_eq!(line("signal.1.rpm"), Some(15));
        assert_eq!(line("bench.noise_a"), Some(17));
        let set = [("bench.noise_a".to_owned(), Value::Float(1.0))];
        assert_eq!(line_of(FILE, "bench.noise_a", &set), None);
        assert_eq!(line("params.MOT_KV"), None);
        assert_eq!(line_of("no TOML", "bench", &[]), None);
    }

    #[test]
    fn a_byte_has_a_key() {
        let key = |text: &str| key_at(FILE, FILE.find(text).unwrap()).unwrap();
        assert_eq!(key("2.0 }"), "bench.scale.L");
        assert_eq!(key("L ="), "bench.scale.L");
        assert_eq!(key("9e9"), "bench.offset_a.2");
        assert_eq!(key("2.0\n[sweep"), "signal.1.rpm");
        assert_eq!(key("[0.0, 1.0]"), "random.bench.noise_a");
        assert_eq!(key("{ R"), "bench.scale");
        assert_eq!(key("[[signal]]\nat_s = 1.0"), "signal.1");
        assert_eq!(key_at(FILE, FILE.len()), None);
    }
}
