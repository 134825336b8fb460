//! What is told in words, and numbers in decimal.

use super::files::View;
use super::sink::Sink;

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
