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
    let (mut equal, mut changed) = (0, 0);
    let mut refused: Vec<(&Line, String)> = Vec::new();
    for line in lines {
        let Param { name, value } = &line.param;
        match present.get(name) {
            None => refused.push((line, "no such parameter".into())),
            Some(now) if same(*now, *value) => equal += 1,
            Some(_) => match params::set(session, name, *value)? {
                SetOutcome::Taken => {
                    changed += 1;
                    print(std::slice::from_ref(&line.param), false, out)?;
                }
                SetOutcome::Refused(reason) => refused.push((line, reason)),
            },
        }
    }

    // A derived value is never accepted, and has become right by those that it follows from.
    let mut left = Vec::new();
    for (line, reason) in refused {
        let Param { name, value } = &line.param;
        if present.contains_key(name) && same(params::get(session, name)?, *value) {
            equal += 1;
        } else {
            left.push((line, reason));
        }
    }
    let refused = left;
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
