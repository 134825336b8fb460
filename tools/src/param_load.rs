//! `siskin params load`: sets the ESC to a file's settings.

use std::collections::HashMap;
use std::io::Write;

use crate::error::Error;
use crate::param_commands::print;
use crate::param_file::Line;
use crate::param_text;
use crate::params::{self, Param, SetOutcome};
use crate::session::Session;

/// Sets what differs from the ESC; returns the number of settings refused.
pub(crate) fn load(
    session: &mut Session,
    lines: &[Line],
    out: &mut dyn Write,
    complaints: &mut dyn Write,
) -> Result<usize, Error> {
    let present: HashMap<String, f32> = params::list(session)?
        .into_iter()
        .map(|p| (p.name, p.value))
        .collect();
    let mut equal = 0;
    let mut changed = 0;
    let mut refused: Vec<(&Line, String)> = Vec::new();
    let mut open: Vec<&Line> = Vec::new();
    for line in lines {
        match present.get(&line.param.name) {
            None => refused.push((line, "no such parameter".into())),
            Some(now) if same(*now, line.param.value) => equal += 1,
            Some(_) => open.push(line),
        }
    }

    // A value may be refused only because another, further down, is still the old one; and a derived one,
    // which is never accepted, may have become right meanwhile. So retry the refused ones as long as that
    // makes progress.
    let mut again = false;
    loop {
        let before = open.len();
        let mut left = Vec::new();
        for line in open {
            let Param { name, value } = &line.param;
            if again && same(params::get(session, name)?, *value) {
                equal += 1;
                continue;
            }
            match params::set(session, name, *value)? {
                SetOutcome::Taken => {
                    changed += 1;
                    print(std::slice::from_ref(&line.param), false, out)?;
                }
                SetOutcome::Refused(reason) => left.push((line, reason)),
            }
        }
        if left.is_empty() || left.len() == before {
            refused.extend(left);
            break;
        }
        open = left.into_iter().map(|(line, _)| line).collect();
        again = true;
    }

    refused.sort_by_key(|(line, _)| line.number);
    for (line, reason) in &refused {
        let Param { name, value } = &line.param;
        let remedy = param_text::remedy(name, *value);
        writeln!(
            complaints,
            "line {}: {name} {value}: {reason}{remedy}",
            line.number
        )?;
    }
    writeln!(
        out,
        "{changed} changed, {equal} equal already, {} refused",
        refused.len()
    )?;
    Ok(refused.len())
}

/// Returns whether two values are equal except for the last digits, which a file may have lost.
pub(crate) fn same(a: f32, b: f32) -> bool {
    (a - b).abs() <= 2.0 * f32::EPSILON * a.abs().max(b.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_last_digit_makes_no_difference() {
        assert!(same(352.842_7, 352.842_68));
        assert!(same(0.0, -0.0));
        assert!(!same(352.842_7, 352.843));
        assert!(!same(0.0, 1e-6));
    }
}
