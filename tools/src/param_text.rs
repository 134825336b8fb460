//! What people read about a parameter: unit, range, choices and description, from the table built into this
//! program. An ESC of another version may have other parameters: only their value is shown.

use std::fmt::Write as _;
use std::io::Write;

use siskin_params::{Kind, ParamId};

use crate::error::Error;
use crate::params::{NAME_LENGTH, Param};

/// Formats a value with its unit, or its meaning if it is a choice: `20 A`, `1 (brake)`.
pub(crate) fn value(name: &str, value: f32) -> String {
    let Some(text) = ParamId::find(name).map(ParamId::text) else {
        return value.to_string();
    };
    if let Some(meaning) = zero(name).filter(|_| value == 0.0) {
        return format!("0 ({meaning})");
    }
    let mut choices = text.choices.iter();
    match choices.find(|(number, _)| f32::from(*number) == value) {
        Some((_, meaning)) => format!("{value} ({meaning})"),
        None if text.unit.is_empty() => value.to_string(),
        None => format!("{value} {}", text.unit),
    }
}

/// Returns what 0 means for a parameter for which it stands for something else.
fn zero(name: &str) -> Option<&'static str> {
    let id = ParamId::find(name)?;
    match id {
        // The only whole number among the motor's parameters.
        ParamId::MotPolePairs => Kind::OfMotor.zero(),
        _ => id.entry().kind.zero(),
    }
}

/// Returns what to give instead of a value that is out of range: `; give 1 to 60 A`.
pub(crate) fn remedy(name: &str, value: f32) -> String {
    let Some(id) = ParamId::find(name) else {
        return String::new();
    };
    let entry = id.entry();
    let whole = matches!(entry.kind, Kind::Whole | Kind::Order);
    let fits = entry.allows(value) && (!whole || value.fract() == 0.0);
    match entry.kind {
        // The ESC has said that nobody sets it.
        Kind::Derived => String::new(),
        _ if fits => String::new(),
        _ => format!("; give {}", range(id)),
    }
}

/// Returns whether this program knows the parameter and it has a factory value of its own.
pub(crate) fn has_factory(name: &str) -> bool {
    ParamId::find(name).is_some_and(|id| id.entry().kind != Kind::Derived)
}

/// Prints a parameter with everything known about it.
pub(crate) fn describe(
    param: &Param,
    factory: Option<f32>,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let Param { name, value: now } = param;
    writeln!(out, "{name:<NAME_LENGTH$} {}", value(name, *now))?;
    let Some(id) = ParamId::find(name) else {
        writeln!(out, "    not known to this program")?;
        return Ok(());
    };
    let mut facts = String::new();
    if let Some(factory) = factory {
        // Writing to a String cannot fail.
        let _ = write!(
            facts,
            "{}; from the factory {}",
            range(id),
            value(name, factory)
        );
        if !id.entry().live {
            facts.push_str("; taken at rest only");
        }
    }
    let parts: Vec<_> = id.text().parts.iter().map(|part| part.name()).collect();
    if !parts.is_empty() {
        let _ = write!(facts, "; used by the part {}", parts.join(" or "));
    }
    if id.text().restart {
        facts.push_str("; applies at the next start");
    }
    writeln!(out, "    {}", id.text().description)?;
    if !facts.is_empty() {
        writeln!(out, "    {facts}")?;
    }
    Ok(())
}

/// Formats as `1 to 60 A`, `a whole number from 1 to 64`, `0 (coast) or 1 (brake)`.
fn range(id: ParamId) -> String {
    let (entry, text) = (id.entry(), id.text());
    if let Some(((last, meaning), others)) = text.choices.split_last() {
        let choice = |number: u8, meaning: &str| match id.part(number) {
            Some(part) => format!("{number} ({meaning}; part {})", part.name()),
            None => format!("{number} ({meaning})"),
        };
        let others: Vec<_> = others
            .iter()
            .map(|(n, meaning)| choice(*n, meaning))
            .collect();
        return format!("{} or {}", others.join(", "), choice(*last, meaning));
    }
    let whole = match entry.kind {
        Kind::Whole => "a whole number from ",
        Kind::Real | Kind::FromMotor | Kind::OfMotor | Kind::Derived | Kind::Order => "",
    };
    let range = format!("{whole}{}", entry.range());
    match text.unit {
        "" => range,
        unit => format!("{range} {unit}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_have_their_unit_or_their_meaning() {
        assert_eq!(value("LIM_PHASE_A", 20.0), "20 A");
        assert_eq!(value("MOT_STOP", 1.0), "1 (brake)");
        assert_eq!(value("MOT_POLE_PAIRS", 7.0), "7");
        assert_eq!(value("OF_ANOTHER_ESC", 0.5), "0.5");
    }

    #[test]
    fn a_choice_and_a_parameter_name_the_part_that_they_need() {
        let range = range(ParamId::CtlSpeed);
        assert!(
            range.contains("1 (PI with feed-forward of CTL_FF_A; part propeller)"),
            "{range}"
        );
        let param = Param {
            name: "CTL_FF_A".to_owned(),
            value: 8.4,
        };
        let mut text = Vec::new();
        describe(&param, Some(8.4), &mut text).unwrap();
        let text = String::from_utf8(text).unwrap();
        assert!(text.contains("used by the part propeller"), "{text}");
    }

    #[test]
    fn a_value_beyond_its_range_is_told_the_range() {
        let entry = ParamId::LimPhaseA.entry();
        let told = format!("; give {} to {} A", entry.min, entry.max);
        assert_eq!(remedy("LIM_PHASE_A", -1.0), told);
        assert_eq!(remedy("LIM_PHASE_A", 20.0), "");
        assert_eq!(remedy("MOT_STOP", 2.0), "; give 0 (coast) or 1 (brake)");
        assert_eq!(
            remedy("MOT_POLE_PAIRS", 6.5),
            "; give a whole number from 0 to 64"
        );
        assert_eq!(remedy("MOT_KV", 1.0), "");
    }

    #[test]
    fn every_parameter_can_be_described() {
        for id in ParamId::ALL {
            let mut text = Vec::new();
            let entry = id.entry();
            let param = Param {
                name: entry.name.to_owned(),
                value: entry.default,
            };
            describe(&param, Some(entry.default), &mut text).unwrap();
            let text = String::from_utf8(text).unwrap();
            assert!(text.contains(id.text().description), "{text}");
            assert!(text.lines().count() >= 2, "{text}");
        }
    }
}
