//! What is told in words, and numbers in decimal.

use super::files::View;
use super::sink::Sink;
use crate::drive::Fault;

/// `@SYS/faults.txt`: what has gone wrong, and what holds the bridge off.
pub(super) fn faults(view: &View, sink: &mut Sink) {
    sink.put(b"Faults since the start: ");
    decimal(view.telemetry.fault_count, sink);
    for fault in view.telemetry.faults.iter() {
        sink.put(b"\nNow: ");
        sink.put(fault.text().as_bytes());
    }
    if !view.warning.is_empty() {
        sink.put(b"\nLast warning: ");
        sink.put(view.warning.as_bytes());
    }
    sink.put(b"\n");
}

/// `@SYS/statistics.txt`: one answer holds it as long as few kinds of faults have been.
pub(super) fn statistics(view: &View, sink: &mut Sink) {
    let statistics = &view.telemetry.statistics;
    let rows = [
        ("Run time: ", statistics.run_s, " s\n"),
        ("Starts: ", statistics.starts, "\n"),
        (
            "Highest temperature: ",
            statistics.temperature_max_c as u32,
            " C\n",
        ),
        (
            "Highest phase current: ",
            statistics.phase_max_a as u32,
            " A\n",
        ),
    ];
    let faults = Fault::ALL.into_iter().zip(statistics.faults);
    let faults = faults.filter(|(_, count)| *count > 0);
    let faults = faults.map(|(fault, count)| (fault.text(), count));
    for (name, number, unit) in rows {
        sink.put(name.as_bytes());
        decimal(number, sink);
        sink.put(unit.as_bytes());
    }
    for (name, number) in faults {
        sink.put(b"Fault, ");
        sink.put(name.as_bytes());
        sink.put(b": ");
        decimal(number, sink);
        sink.put(b"\n");
    }
}

/// A number in decimal. The formatting of the core library would take 3 KB of a chip's image.
pub(super) fn decimal(number: u32, sink: &mut Sink) {
    let mut worth = 1_000_000_000;
    while worth > 0 {
        if number >= worth || worth == 1 {
            sink.put(&[b'0' + (number / worth % 10) as u8]);
        }
        worth /= 10;
    }
}
