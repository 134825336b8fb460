//! The wires as on a logic analyser: a value change dump with a resolution of 1 ns.
//!
//! GTKWave and PulseView read it. PulseView samples at that resolution: for more than some tenths
//! of a second, open it with a downsample factor of 10 or 100.

use std::fs::File;
use std::io::{self, BufWriter};

use siskin_control::drive::{Fault, Phase};
use vcd::{IdCode, TimescaleUnit, Writer};

use super::sink::Sink;
use crate::plant::{Gate, Gates};
use crate::rig::{Period, Rig};
use crate::surroundings::Passage;

// Indices of the wires.
const BRIDGE: usize = 0;
const SIGNAL: usize = 6;
const HALL: usize = 7;
const PHASE: usize = 10;
const FAULT: usize = PHASE + Phase::ALL.len();

/// Returns the scopes with their wires, in index order. Each phase and each fault has a wire: older
/// PulseViews drop multi-bit signals, and none shows text.
fn wires() -> [(&'static str, Vec<String>); 5] {
    let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    let phases = Phase::ALL.map(|phase| format!("{phase:?}").to_lowercase());
    let faults = Fault::ALL.map(|fault| fault.text().replace([' ', '-'], "_"));
    let bridge = ["a_high", "a_low", "b_high", "b_low", "c_high", "c_low"];
    [
        ("bridge", names(&bridge)),
        ("throttle", names(&["signal"])),
        ("hall", names(&["hall_a", "hall_b", "hall_c"])),
        ("phase", phases.into()),
        ("fault", faults.into()),
    ]
}

/// A wire's level from a time on.
#[derive(Clone, Copy, Debug)]
struct Change {
    time_ns: u64,
    wire: usize,
    level: bool,
}

/// A VCD file.
pub(super) struct Vcd {
    writer: Writer<BufWriter<File>>,
    codes: Vec<IdCode>,
    levels: Vec<Option<bool>>,
    gates: Gates,
    /// Not written yet: the throttle wire's edges arrive later than the bridge's around them.
    waiting: Vec<Change>,
    written_ns: Option<u64>,
    end_ns: u64,
}

impl Vcd {
    pub(super) fn new(file: File) -> io::Result<Self> {
        let mut writer = Writer::new(BufWriter::new(file));
        writer.version(concat!("siskin-emulator ", env!("CARGO_PKG_VERSION")))?;
        writer.timescale(1, TimescaleUnit::NS)?;
        writer.add_module("siskin")?;
        let mut codes = Vec::new();
        for (scope, names) in wires() {
            writer.add_module(scope)?;
            for name in names {
                codes.push(writer.add_wire(1, &name)?);
            }
            writer.upscope()?;
        }
        writer.upscope()?;
        writer.enddefinitions()?;
        let start = (0..codes.len()).map(|wire| Change {
            time_ns: 0,
            wire,
            level: false,
        });
        Ok(Self {
            writer,
            levels: vec![None; codes.len()],
            gates: Gates::default(),
            waiting: start.collect(),
            codes,
            written_ns: None,
            end_ns: 0,
        })
    }

    /// Writes the changes before this time, which are all known.
    fn write_before(&mut self, end_ns: u64) -> io::Result<()> {
        self.waiting
            .sort_by_key(|change| (change.time_ns, change.wire));
        let known = self
            .waiting
            .partition_point(|change| change.time_ns < end_ns);
        // Of simultaneous changes the last counts: a half that ends with a switch off and the next
        // that begins with it on is no change.
        let mut changes = self.waiting.drain(..known).peekable();
        while let Some(change) = changes.next() {
            let same = |next: &Change| next.time_ns == change.time_ns && next.wire == change.wire;
            let level = Some(change.level);
            if changes.peek().is_some_and(same) || self.levels[change.wire] == level {
                continue;
            }
            if self.written_ns != Some(change.time_ns) {
                self.writer.timestamp(change.time_ns)?;
                self.written_ns = Some(change.time_ns);
            }
            self.levels[change.wire] = level;
            self.writer
                .change_scalar(self.codes[change.wire], change.level)?;
        }
        Ok(())
    }
}

impl Sink for Vcd {
    fn period(&mut self, t_s: f64, period: &Period, rig: &Rig) -> io::Result<()> {
        let start_ns = (t_s * 1e9).round() as u64;
        let snapshot = rig.snapshot();
        self.write_before(start_ns)?;
        let mut change = |time_ns, wire, level| {
            self.waiting.push(Change {
                time_ns,
                wire,
                level,
            });
        };
        for phase in 0..3 {
            let level = period.sample.hall >> phase & 1 != 0;
            change(start_ns, HALL + phase, level);
        }
        for (place, phase) in Phase::ALL.into_iter().enumerate() {
            change(start_ns, PHASE + place, snapshot.phase == phase);
        }
        for (place, fault) in Fault::ALL.into_iter().enumerate() {
            change(start_ns, FAULT + place, snapshot.faults.contains(fault));
        }
        let (period_s, dead_time_s) = (rig.period_s(), rig.dead_time_s());
        self.gates
            .period(period.halves, period_s, dead_time_s, |at_s, leg, gate| {
                let time_ns = start_ns + (at_s * 1e9).round() as u64;
                change(time_ns, BRIDGE + 2 * leg, gate.high);
                change(time_ns, BRIDGE + 2 * leg + 1, gate.low);
            });
        self.end_ns = start_ns + (period_s * 1e9).round() as u64;
        Ok(())
    }

    fn passage(&mut self, t_s: f64, passage: &Passage) -> io::Result<()> {
        let start_ns = (t_s * 1e9).round() as u64;
        // The control's wires stay unknown.
        self.waiting.retain(|change| change.wire < PHASE);
        self.write_before(start_ns)?;
        self.waiting.extend((0..3).map(|phase| Change {
            time_ns: start_ns,
            wire: HALL + phase,
            level: passage.hall >> phase & 1 != 0,
        }));
        self.end_ns = start_ns + (passage.length_s * 1e9).round() as u64;
        Ok(())
    }

    fn gates(&mut self, time_ns: u64, leg: usize, gate: Gate) -> io::Result<()> {
        self.waiting.extend(
            [gate.high, gate.low]
                .into_iter()
                .enumerate()
                .map(|(side, level)| Change {
                    time_ns,
                    wire: BRIDGE + 2 * leg + side,
                    level,
                }),
        );
        Ok(())
    }

    fn edge(&mut self, time_ns: u64, level: bool) -> io::Result<()> {
        self.waiting.push(Change {
            time_ns,
            wire: SIGNAL,
            level,
        });
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.write_before(u64::MAX)?;
        // The last levels are held until here.
        if self.written_ns < Some(self.end_ns) {
            self.writer.timestamp(self.end_ns)?;
        }
        self.writer.flush()
    }
}
