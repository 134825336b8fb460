//! Parameter files.
//!
//! Files are written as `NAME VALUE`, separated by white space, with `#` before comments: MAVProxy and
//! Mission Planner both read that, and MAVProxy writes it. They are read in that format, in Mission
//! Planner's `NAME,VALUE`, and in QGroundControl's five columns: system, component, name, value, type.

use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;

use siskin_scope::printable;

use crate::error::Error;
use crate::params::{NAME_LENGTH, Param, is_name};

/// A setting in a file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Line {
    /// Line number from 1.
    pub(crate) number: usize,
    /// Component id, if the format states it.
    component: Option<u8>,
    pub(crate) param: Param,
}

/// Returns the text of a file with these parameters, and whose they are. Values have as many digits as it
/// takes to read back the same number.
pub(crate) fn write(of: &str, params: &[Param]) -> String {
    let count = params.len();
    let mut file = format!("# Siskin: {count} parameters of {of}\n# NAME VALUE\n");
    for Param { name, value } in params {
        // Formatting into a string cannot fail.
        let _ = writeln!(file, "{name:<NAME_LENGTH$} {value}");
    }
    file
}

/// Parses a file, or says what is wrong with each bad line.
///
/// # Errors
/// One text per bad line, with its number.
pub(crate) fn read(file: &str) -> Result<Vec<Line>, Vec<String>> {
    let mut lines = Vec::new();
    let mut bad = Vec::new();
    let mut seen = HashMap::new();
    for (index, text) in file.trim_start_matches('\u{feff}').lines().enumerate() {
        let number = index + 1;
        match read_line(text) {
            Ok(None) => {}
            Ok(Some((component, param))) => {
                match seen.insert((component, param.name.clone()), number) {
                    None => lines.push(Line {
                        number,
                        component,
                        param,
                    }),
                    Some(first) => {
                        bad.push(format!(
                            "line {number}: {} is already on line {first}",
                            param.name
                        ));
                    }
                }
            }
            Err(reason) => bad.push(format!("line {number}: {reason}")),
        }
    }
    if bad.is_empty() { Ok(lines) } else { Err(bad) }
}

/// Returns a file's settings for a component: if it has several components, the lines of this one; a file
/// with a single component is for any, so that an ESC's settings can be copied to the next.
///
/// # Errors
/// [`Error::File`] if there are none.
pub(crate) fn for_component(
    file: &Path,
    lines: Vec<Line>,
    component: u8,
) -> Result<Vec<Line>, Error> {
    let lines = chosen(lines, component);
    if lines.is_empty() {
        let reason = format!("it has no setting for component {component}");
        return Err(Error::file(file, reason));
    }
    Ok(lines)
}

fn chosen(lines: Vec<Line>, component: u8) -> Vec<Line> {
    let several = lines
        .windows(2)
        .any(|pair| pair[0].component != pair[1].component);
    lines
        .into_iter()
        .filter(|line| !several || line.component.is_none_or(|n| n == component))
        .collect()
}

/// Returns the component, if the format states it, and the setting; `None` for a line without one.
fn read_line(line: &str) -> Result<Option<(Option<u8>, Param)>, String> {
    let content = line.split('#').next().unwrap_or("");
    let columns: Vec<&str> = content
        .split([' ', '\t', ',', '\r'])
        .filter(|column| !column.is_empty())
        .collect();
    let (component, name, value) = match columns[..] {
        [] => return Ok(None),
        [name, value] => (None, name, value),
        [_, component, name, value, _] => {
            let id = component
                .parse::<u8>()
                .map_err(|_| format!("'{}' is not a component id", shown(component)))?;
            (Some(id), name, value)
        }
        _ => return Err(format!("'{}' is not NAME VALUE", shown(line.trim()))),
    };
    if !is_name(name) {
        return Err(format!("'{}' is not a parameter name", shown(name)));
    }
    match value.parse::<f32>() {
        Ok(number) if number.is_finite() => Ok(Some((
            component,
            Param {
                name: name.into(),
                value: number,
            },
        ))),
        _ => Err(format!("'{}' is not a number for {name}", shown(value))),
    }
}

/// Returns at most 40 characters, safe for a terminal.
fn shown(text: &str) -> String {
    printable::line(&text.chars().take(40).collect::<String>())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    use super::*;

    const OWN: &str = "the ESC 1.140";

    fn names_and_values(file: &str) -> Vec<(usize, String, f32)> {
        chosen(read(file).expect("a sound file"), 140)
            .into_iter()
            .map(|line| (line.number, line.param.name, line.param.value))
            .collect()
    }

    #[test]
    fn the_formats_of_the_ground_tools_are_read() {
        let expected = vec![
            (3, "MOT_POLE_PAIRS".to_owned(), 12.0),
            (4, "MOT_L_UH".to_owned(), 30.6),
            (6, "CTL_X".to_owned(), -1.5e-3),
        ];
        for file in [
            // MAVProxy
            "# saved\n\nMOT_POLE_PAIRS   12.000000\nMOT_L_UH         30.600000 # uH\n\nCTL_X -0.001500\n",
            // Mission Planner, with Windows line ends
            "#NOTE: 1/1/2030\r\n\r\nMOT_POLE_PAIRS,12\r\nMOT_L_UH,30.6\r\n\r\nCTL_X,-1.5E-3\r\n",
            // QGroundControl
            "# Vehicle-Id Component-Id Name Value Type\n#\n1\t140\tMOT_POLE_PAIRS\t12.000000000000000000\t9\n\
             1\t140\tMOT_L_UH\t30.600000381469726562\t9\n\n1\t140\tCTL_X\t-0.001500000013038516\t9\n",
        ] {
            assert_eq!(names_and_values(file), expected);
        }
    }

    #[test]
    fn a_file_of_several_components_yields_one() {
        let file = "1\t1\tA\t1\t9\n1\t140\tA\t2\t9\n1\t140\tB\t3\t9\n";
        assert_eq!(
            names_and_values(file),
            [(2, "A".into(), 2.0), (3, "B".into(), 3.0)]
        );
        let other = "1\t141\tA\t1\t9\n";
        assert_eq!(names_and_values(other), [(1, "A".into(), 1.0)]);
    }

    #[test]
    fn every_bad_line_is_named() {
        let file = "GOOD 1\nNO_VALUE\nA_NAME_THAT_IS_TOO_LONG 1\nWORD fast\nNAN NaN\nBIG 1e40\n\
                    1 2 3\n1\tx\tA\t1\t9\nGOOD 2\n";
        let bad = read(file).expect_err("bad lines");
        let numbers: Vec<&str> = bad
            .iter()
            .filter_map(|text| text.split(':').next())
            .collect();
        assert_eq!(
            numbers,
            [
                "line 2", "line 3", "line 4", "line 5", "line 6", "line 7", "line 8", "line 9"
            ]
        );
        assert!(bad[7].contains("already on line 1"), "{}", bad[7]);
    }

    proptest! {
        // Always the same cases, so that a run can be repeated.
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(1),
            ..ProptestConfig::default()
        })]

        #[test]
        fn what_is_written_is_read_back_to_the_bit(
            values in proptest::collection::vec(proptest::num::f32::NORMAL | proptest::num::f32::ZERO, 0..40)
        ) {
            let params: Vec<Param> = values
                .iter()
                .enumerate()
                .map(|(i, &value)| Param { name: format!("P_{i}"), value })
                .collect();
            let lines = read(&write(OWN, &params)).expect("own format");
            prop_assert_eq!(lines.len(), params.len());
            for (line, param) in lines.iter().zip(&params) {
                prop_assert_eq!(&line.param.name, &param.name);
                prop_assert_eq!(line.param.value.to_bits(), param.value.to_bits());
            }
        }

        #[test]
        fn any_text_is_read_or_refused(file in "\\PC*[\\n\\t ,#0-9A-Z]*") {
            // A line is a setting, an error, or neither.
            let found = read(&file).map_or_else(|bad| bad.len(), |lines| lines.len());
            prop_assert!(found <= file.lines().count());
        }
    }
}
