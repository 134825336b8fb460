//! How the processor's time is spent: figures of the PWM interrupt, and how soon a throttle acts.

use std::fmt;

use serde::Serialize;

use crate::processor::ENTRY;
use crate::time::{CLOCK_HZ, Cycles};

/// The PWM interrupt as it has been so far.
#[derive(Clone, Debug, Default)]
pub struct Load {
    /// When its line came up.
    asked: Option<Cycles>,
    /// When it was entered, and after how many instructions.
    entered: Option<(Cycles, u64)>,
    /// Since when this is measured.
    since: Cycles,
    spent: Cycles,
    times: u64,
    instructions: u64,
    longest_instructions: u64,
    longest: Cycles,
    soonest: Option<Cycles>,
    latest: Cycles,
    throttle: Throttle,
}

/// From the end of a frame to the duties that it makes.
#[derive(Clone, Debug, Default)]
struct Throttle {
    /// The end of the last frame.
    frame: Option<Cycles>,
    /// A frame whose set-point is new, until its duties are in force.
    waits: Option<Cycles>,
    /// The set-point of the last period.
    setpoint: u32,
    count: u64,
    sum: Cycles,
    longest: Cycles,
}

impl Load {
    /// Begins anew at a time.
    pub fn begin(&mut self, now: Cycles) {
        *self = Self {
            since: now,
            ..Self::default()
        };
    }

    /// The interrupt's line has come up.
    pub fn asked(&mut self, now: Cycles) {
        self.asked = Some(now);
    }

    /// The handler begins: its first instruction comes next. The processor could have taken it at any
    /// instruction since `since`.
    pub fn entered(&mut self, now: Cycles, instructions: u64, since: Cycles) {
        self.entered = Some((now, instructions));
        // The first one may have been asked for before the interrupt was enabled, and the second while that
        // one was handled.
        if let Some(asked) = self.asked.take()
            && self.times > 1
        {
            let waited = if asked > since { ENTRY } else { now - asked };
            self.soonest = Some(self.soonest.map_or(waited, |soonest| soonest.min(waited)));
            self.latest = self.latest.max(waited);
        }
    }

    /// The handler has ended.
    pub fn left(&mut self, now: Cycles, instructions: u64) {
        if let Some((entered, before)) = self.entered.take() {
            let (spent, count) = (now - entered, instructions - before);
            self.times += 1;
            self.spent += spent;
            self.instructions += count;
            self.longest = self.longest.max(spent);
            self.longest_instructions = self.longest_instructions.max(count);
        }
    }

    /// A frame has ended on the throttle wire.
    pub fn frame(&mut self, now: Cycles) {
        self.throttle.frame = Some(now);
    }

    /// A period begins with this set-point, without its number.
    pub fn setpoint(&mut self, setpoint: u32) {
        if self.throttle.setpoint != setpoint {
            self.throttle.setpoint = setpoint;
            self.throttle.waits = self.throttle.frame.take();
        }
    }

    /// The duties of the last period come into force.
    pub fn duties(&mut self, now: Cycles) {
        if let Some(frame) = self.throttle.waits.take() {
            let took = now - frame;
            self.throttle.count += 1;
            self.throttle.sum += took;
            self.throttle.longest = self.throttle.longest.max(took);
        }
    }

    /// The figures at a time.
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
            cycles_most: self.longest,
            load_percent: 100.0 * self.spent as f64 / passed.max(1) as f64,
            entry_cycles: [soonest, self.latest],
            throttle_us_mean: mean(self.throttle.sum, self.throttle.count).map(|sum| sum * us(1)),
            throttle_us_most: (self.throttle.count > 0).then(|| us(self.throttle.longest)),
        })
    }
}

/// Figures of the PWM interrupt. Instructions are counted; cycles are estimated, by
/// [the model](crate::processor).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Figures {
    /// How often it has run.
    pub interrupts: u64,
    /// Its instructions, mean.
    pub instructions_mean: f64,
    /// Its instructions, most.
    pub instructions_most: u64,
    /// Its cycles from entry to return, mean.
    pub cycles_mean: f64,
    /// Its cycles from entry to return, most.
    pub cycles_most: Cycles,
    /// Its share of the processor.
    pub load_percent: f64,
    /// Cycles from the converters' end to its first instruction: least and most. To the least a chip adds
    /// what is left of the instruction that it is at, as a rule 1 to 3 cycles.
    pub entry_cycles: [Cycles; 2],
    /// From the end of a frame to the duties that it makes, µs, mean.
    pub throttle_us_mean: Option<f64>,
    /// The same, most.
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
        // The first comes within a block of code, the second while it may not be taken.
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
        assert!((figures.load_percent - 100.0 * 1600.0 / 12_000.0).abs() < 1e-9);
        assert_eq!(figures.entry_cycles, [12, 20]);
        assert_eq!(figures.throttle_us_most, Some(30.0));
    }
}
