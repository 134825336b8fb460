//! Texts, and numbers in decimal.

use heapless::String;

use super::sink::Sink;
use super::view::View;
use crate::drive::Fault;

/// `@SYS/faults.txt`: past faults, those that hold the bridge off, and limits that bind.
pub(super) fn faults(view: &View, sink: &mut Sink) {
    sink.put(b"Faults since the start: ");
    decimal(view.telemetry.fault_count, sink);
    let mut name = |word: &str, text: &str| {
        sink.put(word.as_bytes());
        sink.put(text.as_bytes());
    };
    let telemetry = view.telemetry;
    let faults = telemetry.faults.iter();
    faults.for_each(|fault| name("\nNow: ", fault.text()));
    let limits = telemetry.limits.iter();
    limits.for_each(|limit| name("\nLimited by: ", limit.text()));
    if !view.warning.is_empty() {
        name("\nLast warning: ", view.warning);
    }
    sink.put(b"\n");
}

/// `@SYS/statistics.txt`: fits one answer as long as few kinds of faults have occurred.
pub(super) fn statistics(view: &View, sink: &mut Sink) {
    let statistics = &view.telemetry.statistics;
    row("Run time", statistics.run_s, " s\n", sink);
    row("Starts", statistics.starts, "\n", sink);
    let temperature_c = statistics.temperature_max_c as u32;
    row("Highest temperature", temperature_c, " C\n", sink);
    let phase_a = statistics.phase_max_a as u32;
    row("Highest phase current", phase_a, " A\n", sink);
    for (fault, count) in Fault::ALL.iter().zip(&statistics.faults) {
        if *count > 0 {
            sink.put(b"Fault, ");
            row(fault.text(), *count, "\n", sink);
        }
    }
}

// Out of line: there are five calls.
#[inline(never)]
fn row(name: &str, number: u32, unit: &str, sink: &mut Sink) {
    sink.put(name.as_bytes());
    sink.put(b": ");
    decimal(number, sink);
    sink.put(unit.as_bytes());
}

/// `@SYS/check.txt`: a line for each measured item, with its name, value, unit, bounds and whether
/// it is within them; `-` is a value that a sensor does not provide.
pub(super) fn check(view: &View, sink: &mut Sink) {
    view.check.for_each_line(view.params, |line| {
        for piece in [line.name[0], line.name[1], " "] {
            sink.put(piece.as_bytes());
        }
        thousandths(line.value, sink);
        sink.put(line.unit.as_bytes());
        sink.put(b" ");
        thousandths(line.low, sink);
        thousandths(line.high, sink);
        sink.put(if line.ok() { b"ok\n" } else { b"FAILED\n" });
    });
}

/// `@SYS/identify.txt`: a line for each figure, with its name, value, unit and spread in percent.
pub(super) fn identification(view: &View, sink: &mut Sink) {
    view.identification.for_each_line(|line| {
        sink.put(line.name.as_bytes());
        sink.put(b" ");
        thousandths(line.figure.value, sink);
        sink.put(line.unit.as_bytes());
        sink.put(b" ");
        thousandths(100.0 * line.figure.spread, sink);
        sink.put(b"%\n");
    });
}

/// Writes a number with three decimals, and a space.
fn thousandths(number: f32, sink: &mut Sink) {
    let thousandths = (number.abs() * 1000.0 + 0.5) as u32;
    if !number.is_finite() {
        return sink.put(b"- ");
    }
    if number < 0.0 {
        sink.put(b"-");
    }
    decimal(thousandths / 1000, sink);
    let digit = |worth: u32| b'0' + (thousandths / worth % 10) as u8;
    sink.put(&[b'.', digit(100), digit(10), digit(1), b' ']);
}

/// Returns a number with three decimals, between spaces.
pub fn digits(number: f32) -> String<16> {
    let mut bytes = [0; 15];
    thousandths(number, &mut Sink::new(0, &mut bytes));
    let mut text = String::new();
    let _ = text.push(' ');
    for byte in bytes
        .into_iter()
        .take_while(|byte| (b' '..=b'~').contains(byte))
    {
        let _ = text.push(char::from(byte));
    }
    text
}

/// Writes a number in decimal. The core library's formatting would take 3 KB of the image.
pub(super) fn decimal(number: u32, sink: &mut Sink) {
    let mut worth = 1_000_000_000;
    while worth > 0 {
        if number >= worth || worth == 1 {
            sink.put(&[b'0' + (number / worth % 10) as u8]);
        }
        worth /= 10;
    }
}
