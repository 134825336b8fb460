//! Selects the channel that is the wire.

use std::io::BufRead;

use super::capture::{Capture, Reason};

/// Returns the index of the channel given by name or index; otherwise of the only one that changes, for
/// which the whole capture is read.
///
/// # Errors
/// There is no such channel, or more than one.
pub(super) fn choose(
    mut capture: Capture<impl BufRead>,
    wanted: Option<&str>,
) -> Result<usize, Reason> {
    let names = capture.channels().to_vec();
    if let Some(wanted) = wanted {
        return find(&names, wanted);
    }
    if names.len() == 1 {
        return Ok(0);
    }
    let mut changes = vec![false; names.len()];
    while let Some(change) = capture.next()? {
        changes[change.channel] = true;
    }
    let changing: Vec<_> = (0..names.len())
        .filter(|&channel| changes[channel])
        .collect();
    match changing[..] {
        [only] => Ok(only),
        [] => Err("no channel has an edge; capture while the flight controller sends".to_owned()),
        _ => Err(format!(
            "several channels have edges; choose one with --channel: {}",
            list(&names, &changing)
        )),
    }
}

/// Finds a channel by its full name, by the last part of its name (`signal` of `siskin.throttle.signal`),
/// or by its index from 0.
fn find(names: &[String], wanted: &str) -> Result<usize, Reason> {
    let by = |fits: &dyn Fn(&str) -> bool| -> Vec<usize> {
        (0..names.len())
            .filter(|&channel| fits(&names[channel]))
            .collect()
    };
    let last_part = |name: &str| name.rsplit('.').next().unwrap_or(name).to_lowercase();
    let whole = by(&|name| name == wanted);
    let found = if whole.is_empty() {
        by(&|name| last_part(name) == wanted.to_lowercase())
    } else {
        whole
    };
    match found[..] {
        [only] => return Ok(only),
        [] => {}
        _ => {
            return Err(format!(
                "several channels are called '{wanted}'; choose by index: {}",
                list(names, &found)
            ));
        }
    }
    let place = wanted
        .parse()
        .ok()
        .filter(|&place: &usize| place < names.len());
    place.ok_or_else(|| {
        let all: Vec<_> = (0..names.len()).collect();
        format!("there is no channel '{wanted}', only {}", list(names, &all))
    })
}

/// Lists channels by index and name.
fn list(names: &[String], channels: &[usize]) -> String {
    let names: Vec<_> = channels
        .iter()
        .map(|&channel| format!("{channel} {}", names[channel]))
        .collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn a_channel_is_found_by_name_and_by_place() {
        let emulator = names(&["siskin.bridge.a_high", "siskin.throttle.signal"]);
        assert_eq!(find(&emulator, "siskin.throttle.signal"), Ok(1));
        assert_eq!(find(&emulator, "Signal"), Ok(1));
        assert_eq!(find(&emulator, "0"), Ok(0));
        // A name takes precedence over an index.
        assert_eq!(find(&names(&["1", "0"]), "0"), Ok(1));
    }

    #[test]
    fn what_is_not_there_or_twice_is_told_with_what_there_is() {
        let two = names(&["logic", "logic"]);
        let error = find(&two, "logic").expect_err("two of them");
        assert!(error.contains("0 logic, 1 logic"), "{error}");
        let error = find(&names(&["D0", "D1"]), "2").expect_err("none");
        assert!(
            error.contains("'2'") && error.contains("0 D0, 1 D1"),
            "{error}"
        );
    }
}
