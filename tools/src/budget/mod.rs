//! `siskin budget`: the speeds between which the flux crossings hold the rotor's angle.

mod limits;
mod motor;
mod print;

use std::io::Write;

use crate::cli::BudgetArgs;
use crate::error::Error;
use motor::Motor;

/// Computes and prints the budget. `component` selects whose parameters to take from a file with several.
///
/// # Errors
/// [`Error::Usage`] or [`Error::File`] for bad input.
pub(crate) fn run(
    args: &BudgetArgs,
    component: Option<u8>,
    out: &mut dyn Write,
) -> Result<(), Error> {
    let motor = Motor::of(args, component)?;
    let ranges = motor.settings.ranges(args.error);
    if args.json {
        writeln!(out, "{}", print::json(&motor, args.error, &ranges))?;
    } else {
        write!(out, "{}", print::text(&motor, args.error, &ranges))?;
    }
    Ok(())
}
