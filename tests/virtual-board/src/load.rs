//! How the processor's time is spent: figures for the PWM interrupt, and how soon a throttle acts.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::processor::ENTRY;
use crate::time::{CLOCK_HZ, Cycles};

/// The PWM interrupt so far.
#[derive(Clone, Debug, Default)]
pub struct Load {
    /// When its line came up.
    asked: Option<Cycles>,
    /// When it was entered, and after how many instructions.
    entered: Option<(Cycles, u64)>,
    /// When the measurement began.
    since: Cycles,
    spent: Cycles,
    /// How often it has taken each number of cycles.
    took: BTreeMap<Cycles, u64>,
    times: u64,
    instructions: u64,
    longest_instructions: u64,
    longest: Cycles,
    soonest: Option<Cycles>,
    latest: Cycles,
    throttle: Throttle,
}

/// Latency from the end of a frame to the resulting duties.
#[derive(Clone, Debug, Default)]
struct Throttle {
    /// End of the last frame.
    frame: Option<Cycles>,
    /// A frame with a new set-point, until its duties are in force.
    waits: Option<Cycles>,
    /// Set-point of the last period.
    setpoint: u32,
    count: u64,
    sum: Cycles,
    longest: Cycles,
}

impl Load {
    /// Starts over at a time.
    pub fn begin(&mut self, now: Cycles) {
        *self = Self {
            since: now,
            ..Self::default()
        };
    }

    /// Notes that the interrupt's line has come up.
    pub fn asked(&mut self, now: Cycles) {
        self.asked = Some(now);
    }

    /// Notes that the handler begins with the next instruction. The processor could have taken it at any
    /// instruction since `since`.
    pub fn entered(&mut self, now: Cycles, instructions: u64, since: Cycles) {
        self.entered = Some((now, instructions));
        // The first one may have been requested before the interrupt was enabled, and the second while that
        // one was handled.
        if let Some(asked) = self.asked.take()
            && self.times > 1
        {
            let waited = if asked > since { ENTRY } else { now - asked };
            self.soonest = Some(self.soonest.map_or(waited, |soonest| soonest.min(waited)));
            self.latest = self.latest.max(waited);
        }
    }

    /// Returns true while the handler runs.
    pub fn is_in_interrupt(&self) -> bool {
        self.entered.is_some()
    }

    /// Notes that the handler has ended.
    pub fn left(&mut self, now: Cycles, instructions: u64) {
        if let Some((entered, before)) = self.entered.take() {
            let (spent, count) = (now - entered, instructions - before);
            self.times += 1;
            self.spent += spent;
            self.instructions += count;
            self.longest = self.longest.max(spent);
            *self.took.entry(spent).or_default() += 1;
            self.longest_instructions = self.longest_instructions.max(count);
        }
    }

    /// Notes the end of a frame on the throttle wire.
    pub fn frame(&mut self, now: Cycles) {
        self.throttle.frame = Some(now);
    }

    /// Notes the set-point of a period that begins, without its number.
    pub fn setpoint(&mut self, setpoint: u32) {
        if self.throttle.setpoint != setpoint {
            self.throttle.setpoint = setpoint;
            self.throttle.waits = self.throttle.frame.take();
        }
    }

    /// Notes that the last period's duties come into force.
    pub fn duties(&mut self, now: Cycles) {
        if let Some(frame) = self.throttle.waits.take() {
            let took = now - frame;
            self.throttle.count += 1;
            self.throttle.sum += took;
            self.throttle.longest = self.throttle.longest.max(took);
        }
    }

    /// Returns how often it has taken more than this many cycles.
    pub fn longer_than(&self, cycles: Cycles) -> u64 {
        self.took.range(cycles + 1..).map(|(_, times)| times).sum()
    }

    fn median(&self) -> Cycles {
        let mut seen = 0;
        let mut took = self.took.iter();
        let median = took.find(|(_, times)| {
            seen += **times;
            2 * seen > self.times
        });
        median.map_or(0, |(cycles, _)| *cycles)
    }

    /// Returns the figures at a time.
    pub fn figures(&self, now: Cycles) -> Option<Figures> {
        let us = |cycles: Cycles| cycles as f64 * 1e6 / CLOCK_HZ as f64;
        let mean = |sum: u64, count: u64| (count > 0).then(|| sum as f64 / count as f64);
        let passed = now.saturating_sub(self.since);
        let soonest = self.soonest?;
        Some(Figures {
            interrupts: self.times,
            instructions_mean: mean(self.instructions, self.times)?,
            instructions_most: self.longest_instructions,
            cycles_mean: mean(self.spent, self.times)?,
            cycles_median: self.median(),
            cycles_most: self.longest,
            load_percent: 100.0 * self.spent as f64 / passed.max(1) as f64,
            entry_cycles: [soonest, self.latest],
            throttle_us_mean: mean(self.throttle.sum, self.throttle.count).map(|sum| sum * us(1)),
            throttle_us_most: (self.throttle.count > 0).then(|| us(self.throttle.longest)),
        })
    }
}

/// Figures for the PWM interrupt. Instructions are counted; cycles are estimated by
/// [the model](crate::processor).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// How often it has run.
    pub interrupts: u64,
    /// Mean instructions.
    pub instructions_mean: f64,
    /// Maximum instructions.
    pub instructions_most: u64,
    /// Mean cycles from entry to return.
    pub cycles_mean: f64,
    /// Their median.
    pub cycles_median: Cycles,
    /// Maximum cycles from entry to return.
    pub cycles_most: Cycles,
    /// Its share of the processor.
    pub load_percent: f64,
    /// Cycles from the end of the conversions to its first instruction: minimum and maximum. On a chip the
    /// rest of the current instruction adds to the minimum, usually 1 to 3 cycles.
    pub entry_cycles: [Cycles; 2],
    /// Mean time from the end of a frame to the resulting duties, µs.
    pub throttle_us_mean: Option<f64>,
    /// Its maximum.
    pub throttle_us_most: Option<f64>,
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [least, most] = self.entry_cycles;
        writeln!(
            f,
            "PWM interrupt: {} times, {:.0} instructions, at most {}; estimated {:.0} cycles, at most {}; \
             {:.1} % of the processor",
            self.interrupts,
            self.instructions_mean,
            self.instructions_most,
            self.cycles_mean,
            self.cycles_most,
            self.load_percent,
        )?;
        write!(
            f,
            "it begins {least} to {most} cycles after the conversions: jitter of {} cycles",
            most - least
        )?;
        if let (Some(mean), Some(most)) = (self.throttle_us_mean, self.throttle_us_most) {
            write!(
                f,
                "\nthrottle frame to duties: {mean:.1} us, at most {most:.1} us"
            )?;
        }
        writeln!(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_of_the_interrupts_that_have_ended() {
        let mut load = Load::default();
        load.begin(1000);
        assert_eq!(load.figures(2000), None);
        // The first comes within a block of code, the second while it cannot be taken.
        for (asked, since, entered, left, instructions) in [
            (1000, 1000, 4000, 4200, 200),
            (1500, 1500, 4206, 4406, 200),
            (5000, 4990, 5037, 5537, 400),
            (8000, 8000, 8020, 8720, 600),
        ] {
            load.asked(asked);
            load.entered(entered, 7, since);
            load.left(left, 7 + instructions);
        }
        load.frame(9000);
        load.setpoint(5);
        load.duties(9000 + 170 * 30);
        load.setpoint(5);
        load.duties(99_999);
        let figures = load.figures(13_000).unwrap();
        assert_eq!(figures.interrupts, 4);
        assert_eq!(figures.instructions_mean, 350.0);
        assert_eq!(figures.instructions_most, 600);
        assert_eq!((figures.cycles_mean, figures.cycles_most), (400.0, 700));
        assert_eq!(figures.cycles_median, 500);
        assert!((figures.load_percent - 100.0 * 1600.0 / 12_000.0).abs() < 1e-9);
        assert_eq!(figures.entry_cycles, [12, 20]);
        assert_eq!(figures.throttle_us_most, Some(30.0));
    }
}
