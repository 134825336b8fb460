//! Values over time, from a CSV file.

/// The greatest magnitude of a number: anything computed from two of them stays finite.
pub(super) const NUMBER_MAX: f64 = 1e9;

/// Values at rising times, interpolated linearly. The first holds before, the last after.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Course {
    /// Times, s, and the values at them.
    points: Vec<(f64, f64)>,
}

impl Course {
    /// Parses a CSV text: seconds and a value on each line, with or without a header.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, String> {
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(bytes);
        let mut points: Vec<(f64, f64)> = Vec::new();
        for (index, record) in reader.byte_records().enumerate() {
            let record = record.map_err(|error| error.to_string())?;
            let line = record.position().map_or(0, csv::Position::line);
            let numbers: Option<Vec<_>> = record.iter().map(number).collect();
            match numbers.as_deref() {
                Some(&[t_s, value]) => {
                    if points.last().is_some_and(|(last_s, _)| t_s <= *last_s) {
                        return Err(format!("line {line}: the time does not rise"));
                    }
                    points.push((t_s, value));
                }
                // Names of the columns.
                None if index == 0 && record.iter().all(|cell| number(cell).is_none()) => {}
                _ => {
                    return Err(format!(
                        "line {line}: give seconds and a value within ±1e9, as 0.5,0.25"
                    ));
                }
            }
        }
        if points.is_empty() {
            return Err("no line has seconds and a value".to_owned());
        }
        Ok(Self { points })
    }

    /// Returns the value at a time, s.
    pub(super) fn at(&self, t_s: f64) -> f64 {
        let next = self.points.partition_point(|point| point.0 <= t_s);
        match (
            next.checked_sub(1).map(|last| self.points[last]),
            self.points.get(next),
        ) {
            (Some((from_s, from)), Some((to_s, to))) => {
                from + (to - from) * ((t_s - from_s) / (to_s - from_s))
            }
            (Some((_, held)), None) | (None, Some(&(_, held))) => held,
            (None, None) => 0.0,
        }
    }
}

/// Parses a cell as a number that a scenario can use.
fn number(cell: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(cell).ok()?;
    let number = text.parse().ok();
    number.filter(|number| (-NUMBER_MAX..=NUMBER_MAX).contains(number))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_joined_by_lines_and_held_at_the_ends() {
        for header in ["", "t_s, throttle\n"] {
            let text = format!("{header}1.0, 10\n2.0,20 \r\n4.0,-20\n");
            let course = Course::parse(text.as_bytes()).unwrap();
            let values = [0.0, 1.0, 1.25, 2.0, 3.0, 4.0, 9.0].map(|t_s| course.at(t_s));
            assert_eq!(values, [10.0, 10.0, 12.5, 20.0, 0.0, -20.0, -20.0]);
        }
        let single = Course::parse(b"5,7").unwrap();
        assert_eq!(
            (single.at(0.0), single.at(5.0), single.at(6.0)),
            (7.0, 7.0, 7.0)
        );
    }

    #[test]
    fn a_bad_line_is_named() {
        for (text, problem) in [
            ("t,x\n0,1\n0.5\n", "line 3: give seconds"),
            ("0,1\n1,2,3\n", "line 2: give seconds"),
            ("0,1\n1,fast\n", "line 2: give seconds"),
            ("0,1\n1,nan\n", "line 2: give seconds"),
            ("0,1\n1,1e300\n", "line 2: give seconds"),
            ("0;1\n1;2\n", "line 2: give seconds"),
            ("0,x\n1,2\n", "line 1: give seconds"),
            ("0,1\n2,1\n1,1\n", "line 3: the time does not rise"),
            ("0,1\n0,2\n", "line 2: the time does not rise"),
            ("", "no line has"),
            ("t,x\n", "no line has"),
        ] {
            let got = Course::parse(text.as_bytes()).unwrap_err();
            assert!(got.starts_with(problem), "{got} for {text:?}");
        }
        assert!(Course::parse(&[0xff, 0xfe, b'\n', 0xff]).is_err());
    }
}
