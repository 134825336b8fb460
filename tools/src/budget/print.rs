//! Prints a budget for people and for programs.

use std::fmt::Write;

use serde_json::{Value, json};
use siskin_control::control::observer::limits::POSITION_FILTER_VALID_DEG;

use super::limits::{End, HoldOff, Range};
use super::motor::Motor;

/// Returns the settings, and each range with what limits it.
pub(crate) fn text(motor: &Motor, bound_deg: f64, ranges: &[Range]) -> String {
    let mut out = head(motor, bound_deg);
    for range in ranges {
        let low = range
            .lowest
            .as_ref()
            .map_or(0.0, |end| motor.rpm(end.omega));
        let high = motor.rpm(range.highest.omega);
        line(
            &mut out,
            &format!("within {bound_deg} deg from {low:.0} to {high:.0} rpm"),
        );
        match &range.lowest {
            Some(end) => limit(&mut out, motor, "below", end),
            None => line(&mut out, "  below: nothing, down to standstill"),
        }
        limit(&mut out, motor, "above", &range.highest);
    }
    if ranges.is_empty() {
        line(&mut out, &format!("within {bound_deg} deg at no speed"));
        if let Some(best) = motor.settings.best(bound_deg) {
            limit(&mut out, motor, "best, at", &best);
        }
    }
    out
}

fn head(motor: &Motor, bound_deg: f64) -> String {
    let settings = &motor.settings;
    let mut out = String::new();
    line(
        &mut out,
        &format!(
            "Angle of the flux crossings (CTL_OBSERVER 1), error up to {bound_deg} electrical deg"
        ),
    );
    let mut row = |name: &str, value: String| line(&mut out, &format!("  {name:<16} {value}"));
    row("pole pairs", motor.pole_pairs.to_string());
    row("sampling", format!("{:.0} Hz", 1.0 / settings.period_s));
    row(
        "acceleration",
        format!(
            "{:.0} rpm/s, braking {:.0} rpm/s",
            motor.rpm(settings.acceleration),
            motor.rpm(settings.braking)
        ),
    );
    let high_pass = settings
        .tau_hpfs_s
        .map_or(String::new(), |tau_s| format!(", tau_HPFS {tau_s:.4} s"));
    row("tau_int", format!("{:.4} s{high_pass}", settings.tau_int_s));
    row(
        "hold-off",
        match settings.hold_off {
            HoldOff::Time(time_s) => format!("{:.1} us", time_s * 1e6),
            HoldOff::Angle(deg) => format!("{deg:.1} deg at any speed"),
        },
    );
    let above = |omega: f64, below: &str| match omega {
        0.0 => String::new(),
        _ => format!(" above {:.0} rpm, {below} below", motor.rpm(omega)),
    };
    let measured = match settings.every_edge {
        true => "at every crossing",
        false => "once in N turns",
    };
    row(
        "N",
        format!(
            "{}{}, {measured}",
            settings.turns,
            above(settings.whole_turns_above, "1/6")
        ),
    );
    row(
        "A_e",
        format!("{}{}", settings.a_e, above(settings.filter_above, "0")),
    );
    out
}

fn limit(out: &mut String, motor: &Motor, side: &str, end: &End) {
    let mut sources = end.errors.contributions.iter().map(|row| row.source);
    let by_acceleration =
        sources.any(|source| ["extrapolation", "position filter"].contains(&source));
    let direction = match (end.errors.leads, by_acceleration) {
        (true, true) => "ahead while braking",
        (true, false) => "ahead",
        (false, true) => "behind while accelerating",
        (false, false) => "behind",
    };
    let (rpm, total) = (motor.rpm(end.omega), end.errors.total_deg());
    line(
        out,
        &format!("  {side} {rpm:.0} rpm: {total:.1} deg {direction}"),
    );
    for row in &end.errors.contributions {
        let inaccurate = row.source == "position filter" && row.deg > POSITION_FILTER_VALID_DEG;
        let note = if inaccurate {
            "  (the formula no longer holds)"
        } else {
            ""
        };
        line(
            out,
            &format!("    {:<16} {:>6.2} deg{note}", row.source, row.deg),
        );
    }
}

fn line(out: &mut String, text: &str) {
    // Formatting into a string cannot fail.
    let _ = writeln!(out, "{text}");
}

/// Returns the same as one JSON object. An infinite time constant is null, and so is a missing lowest
/// speed.
pub(crate) fn json(motor: &Motor, bound_deg: f64, ranges: &[Range]) -> Value {
    let settings = &motor.settings;
    let (hold_off_s, hold_off_deg) = match settings.hold_off {
        HoldOff::Time(time_s) => (Some(time_s), None),
        HoldOff::Angle(deg) => (None, Some(deg)),
    };
    let ranges: Vec<Value> = ranges
        .iter()
        .map(|range| {
            json!({
                "lowest": range.lowest.as_ref().map(|end| json_end(motor, end)),
                "highest": json_end(motor, &range.highest),
            })
        })
        .collect();
    let best = match ranges.is_empty() {
        true => motor.settings.best(bound_deg),
        false => None,
    };
    json!({
        "error_deg": bound_deg,
        "pole_pairs": motor.pole_pairs,
        "pwm_hz": tidy(1.0 / settings.period_s),
        "acceleration_rpm_s": tidy(motor.rpm(settings.acceleration)),
        "braking_rpm_s": tidy(motor.rpm(settings.braking)),
        "tau_int_s": tidy(settings.tau_int_s),
        "tau_hpfs_s": settings.tau_hpfs_s.map(tidy),
        "hold_off_s": hold_off_s,
        "hold_off_deg": hold_off_deg.map(tidy),
        "turns": settings.turns,
        "every_edge": settings.every_edge,
        "whole_turns_above_rpm": tidy(motor.rpm(settings.whole_turns_above)),
        "a_e": tidy(settings.a_e),
        "filter_above_rpm": tidy(motor.rpm(settings.filter_above)),
        "ranges": ranges,
        "best": best.as_ref().map(|end| json_end(motor, end)),
    })
}

/// Rounds away what is beyond the parameters' single precision.
fn tidy(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

fn json_end(motor: &Motor, end: &End) -> Value {
    let rows = end.errors.contributions.iter();
    let contributions: Vec<Value> = rows
        .map(|row| json!({ "source": row.source, "deg": row.deg }))
        .collect();
    json!({
        "rpm": motor.rpm(end.omega),
        "total_deg": end.errors.total_deg(),
        "leads": end.errors.leads,
        "contributions": contributions,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::budget::limits::{Contribution, Errors};
    use crate::cli::{Cli, Command};
    use clap::Parser;

    #[test]
    fn only_what_an_acceleration_makes_is_said_to_come_of_it() {
        let cli = Cli::parse_from(["siskin", "budget"]);
        let Command::Budget(args) = &cli.command else {
            unreachable!("asked for");
        };
        let motor = Motor::of(args, None).expect("the factory's parameters");
        let said = |leads, source| {
            let contributions = vec![Contribution { source, deg: 20.0 }];
            let errors = Errors {
                leads,
                contributions,
            };
            let mut out = String::new();
            let omega = 100.0;
            limit(&mut out, &motor, "above", &End { omega, errors });
            out.lines().next().unwrap_or_default().to_owned()
        };
        assert!(said(true, "flux integrator").ends_with("20.0 deg ahead"));
        assert!(said(true, "extrapolation").ends_with("20.0 deg ahead while braking"));
        assert!(said(false, "digital delay").ends_with("20.0 deg behind"));
        assert!(said(false, "position filter").ends_with("20.0 deg behind while accelerating"));
    }
}
