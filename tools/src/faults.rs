//! `siskin faults`: the faults that the ESC has on record, and the control periods before a trip.

use std::io::Write;
use std::path::Path;

use serde_json::{Value, json};
use siskin_control::record::{FaultSeen, PeriodSeen, Recorded};

use crate::cli::FaultsArgs;
use crate::error::Error;
use crate::ftp;
use crate::json::{fixed, number};
use crate::session::Session;

/// Where the ESC serves its record.
const RECORD: &str = "@SYS/faults.bin";

/// Prints the record, and saves it to a file on request.
///
/// # Errors
/// [`Error::Partly`] if a fault is on record, [`Error::Refused`] if there is no record.
pub(crate) fn run(
    session: &mut Session,
    args: &FaultsArgs,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let file = ftp::read(session, RECORD)?;
    let recorded = Recorded::read(&file).ok_or(Error::Refused {
        what: RECORD.into(),
        reason: "cannot be parsed; use the siskin program of the image's version".into(),
    })?;
    if let Some(path) = &args.save {
        save(path, &file)?;
    }
    if args.json {
        writeln!(out, "{}", json_of(&recorded))?;
    } else {
        print(&recorded, out)?;
    }
    match recorded.faults.len() {
        0 => Ok(()),
        1 => Err(Error::Partly("one fault on record".into())),
        count => Err(Error::Partly(format!("{count} faults on record"))),
    }
}

fn save(path: &Path, file: &[u8]) -> Result<(), Error> {
    std::fs::write(path, file).map_err(|error| Error::file(path, error))
}

fn json_of(recorded: &Recorded) -> Value {
    let items: Vec<_> = recorded.faults.iter().map(fault_json).collect();
    let periods: Vec<_> = recorded.periods.iter().map(period_json).collect();
    json!({ "items": items, "periods_of": recorded.holder, "periods": periods })
}

fn fault_json(seen: &FaultSeen) -> Value {
    json!({
        "number": seen.number,
        "condition": seen.fault as u8,
        "name": seen.fault.text(),
        "phase": phase(seen),
        "starts_ago": seen.starts_ago,
        "time_s": number(seen.time_s),
        "rpm": number(seen.rpm),
        "bus_v": number(seen.bus_v),
    })
}

fn period_json(seen: &PeriodSeen) -> Value {
    json!({
        "time_s": number(seen.time_s),
        "currents_a": seen.currents_a.map(number),
        "bus_v": number(seen.bus_v),
        "angle_deg": number(seen.angle_deg),
        "rpm": number(seen.rpm),
        "duties": seen.duties.map(|duty| duty.map(number)),
    })
}

fn print(recorded: &Recorded, out: &mut dyn Write) -> Result<(), Error> {
    if recorded.faults.is_empty() {
        writeln!(out, "no fault since power-up")?;
    }
    for seen in &recorded.faults {
        writeln!(out, "{}", line(seen))?;
    }
    if let Some(holder) = recorded.holder {
        writeln!(
            out,
            "the {} control periods before fault {holder} are on record; --save keeps them for a plot",
            recorded.periods.len()
        )?;
    }
    Ok(())
}

/// Formats a fault in at most 79 characters, unless the ESC has run for months.
fn line(seen: &FaultSeen) -> String {
    let when = match seen.starts_ago {
        0 => String::new(),
        1 => " one start ago".to_owned(),
        starts => format!(" {starts} starts ago"),
    };
    format!(
        "{:>3} {:<21} in {:<8} at {:>9.3} s {:>6} rpm {:>5} V{when}",
        seen.number,
        seen.fault.text(),
        phase(seen),
        seen.time_s,
        fixed(seen.rpm, 0),
        fixed(seen.bus_v, 1),
    )
}

/// Spells the phase as recordings do.
fn phase(seen: &FaultSeen) -> String {
    format!("{:?}", seen.phase).to_lowercase()
}

#[cfg(test)]
mod tests {
    use siskin_control::drive::{Fault, Phase};

    use super::*;

    #[test]
    fn a_fault_is_a_line() {
        let mut seen = FaultSeen {
            number: 12,
            fault: Fault::CurrentSensor,
            phase: Phase::Stopping,
            starts_ago: 0,
            time_s: 1234.5678,
            rpm: 12_345.0,
            bus_v: 23.94,
        };
        let told = " 12 current sensor defect in stopping at  1234.568 s  12345 rpm  23.9 V";
        assert_eq!(line(&seen), told);
        seen.starts_ago = 1;
        assert_eq!(line(&seen), format!("{told} one start ago"));
        assert_eq!(fault_json(&seen)["condition"], 6);
    }
}
