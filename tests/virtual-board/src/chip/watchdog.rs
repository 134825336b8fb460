//! IWDG: the independent watchdog, clocked by LSI at 32 kHz (RM0440, 42.4).
//!
//! Its registers take effect at once, while the chip takes a few cycles of LSI: SR reads 0. LSI is exact,
//! while the chip's runs at 29.5 to 34 kHz (DS12589).

use stm32_metapac::iwdg::regs::{Kr, Pr, Rlr};
use stm32_metapac::iwdg::vals::Key;

use super::{Cause, Context, Part, Signal, Unmodelled};
use crate::time::{CLOCK_HZ, Cycles, NEVER};

/// LSI's frequency.
const LSI_HZ: u64 = 32_000;

/// What it counts down from by default.
const LONGEST: u16 = 0xfff;

/// The part. Once started, only a reset of the chip stops it.
#[derive(Debug)]
pub struct Watchdog {
    open: bool,
    prescaler: Pr,
    reload: Rlr,
    runs: bool,
    ends: Cycles,
}

impl Watchdog {
    /// Creates it as after a reset: not running.
    pub fn new() -> Self {
        let mut reload = Rlr(0);
        reload.set_rl(LONGEST);
        Self {
            open: false,
            prescaler: Pr(0),
            reload,
            runs: false,
            ends: NEVER,
        }
    }

    /// Returns the time to count down from `count` and once more.
    fn time(&self, count: u16) -> Cycles {
        // 4 to 256; the last two are the same.
        let divider = 4 << self.prescaler.pr().to_bits().min(6);
        let ticks: u64 = (u64::from(count) + 1) * divider;
        (ticks * CLOCK_HZ).div_ceil(LSI_HZ)
    }
}

impl Default for Watchdog {
    fn default() -> Self {
        Self::new()
    }
}

impl Part for Watchdog {
    fn read(&mut self, offset: u32, _: &mut Context) -> Result<u32, Unmodelled> {
        match offset {
            0x04 => Ok(self.prescaler.0),
            0x08 => Ok(self.reload.0),
            0x0c => Ok(0),
            0x10 => Ok(LONGEST.into()),
            _ => Err(Unmodelled),
        }
    }

    fn write(&mut self, offset: u32, value: u32, context: &mut Context) -> Result<(), Unmodelled> {
        match offset {
            0x00 => {
                let key = Kr(value).key();
                self.open = key == Key::ENABLE;
                if key == Key::START && !self.runs {
                    self.runs = true;
                    // The reload value is first used by the first reload.
                    self.ends = context.now + self.time(LONGEST);
                } else if key == Key::RESET && self.runs {
                    self.ends = context.now + self.time(self.reload.rl());
                }
            }
            // The prescaler may only change while it stands: what has already been counted would stay.
            0x04 if self.open && !self.runs => self.prescaler = Pr(value & 7),
            0x08 if self.open => self.reload = Rlr(value & u32::from(LONGEST)),
            _ => return Err(Unmodelled),
        }
        Ok(())
    }

    fn due(&self) -> Cycles {
        self.ends
    }

    fn act(&mut self, context: &mut Context) {
        if context.now >= self.ends {
            self.ends = NEVER;
            context.signals.push(Signal::Reset(Cause::Watchdog));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEY: u32 = 0x00;
    const UNLOCK: u32 = 0x5555;
    const FEED: u32 = 0xaaaa;
    const START: u32 = 0xcccc;

    fn write(watchdog: &mut Watchdog, offset: u32, value: u32, now: Cycles) {
        let mut signals = Vec::new();
        let mut context = Context {
            now,
            signals: &mut signals,
        };
        watchdog.write(offset, value, &mut context).unwrap();
        assert_eq!(signals, []);
    }

    fn signals_at(watchdog: &mut Watchdog, now: Cycles) -> Vec<Signal> {
        let mut signals = Vec::new();
        let mut context = Context {
            now,
            signals: &mut signals,
        };
        watchdog.act(&mut context);
        signals
    }

    /// What embassy-stm32 makes of 1.6 s: a prescaler of 16 and 3200 counts.
    fn of_1600_ms() -> Watchdog {
        let mut watchdog = Watchdog::new();
        write(&mut watchdog, KEY, UNLOCK, 0);
        write(&mut watchdog, 0x04, 2, 0);
        write(&mut watchdog, 0x08, 3199, 0);
        assert_eq!(watchdog.due(), NEVER);
        watchdog
    }

    #[test]
    fn it_resets_the_chip_1600_ms_after_it_was_fed() {
        let mut watchdog = of_1600_ms();
        write(&mut watchdog, KEY, START, 0);
        write(&mut watchdog, KEY, FEED, CLOCK_HZ);
        let ends = CLOCK_HZ + CLOCK_HZ * 16 / 10;
        assert_eq!(watchdog.due(), ends);
        assert_eq!(signals_at(&mut watchdog, ends - 1), []);
        assert_eq!(
            signals_at(&mut watchdog, ends),
            [Signal::Reset(Cause::Watchdog)]
        );
        assert_eq!(watchdog.due(), NEVER);
    }

    #[test]
    fn it_counts_from_its_longest_until_it_is_fed() {
        let mut watchdog = of_1600_ms();
        write(&mut watchdog, KEY, FEED, 10);
        assert_eq!(watchdog.due(), NEVER, "it has not been started");
        write(&mut watchdog, KEY, START, 1000);
        // 4096 counts of 16 / 32 kHz.
        assert_eq!(watchdog.due(), 1000 + CLOCK_HZ * 2048 / 1000);
        write(&mut watchdog, KEY, START, 2000);
        assert_eq!(watchdog.due(), 1000 + CLOCK_HZ * 2048 / 1000);
    }

    #[test]
    fn what_is_locked_or_not_modelled_is_refused() {
        let mut watchdog = of_1600_ms();
        write(&mut watchdog, KEY, START, 0);
        let mut signals = Vec::new();
        let mut context = Context {
            now: 0,
            signals: &mut signals,
        };
        for (offset, value) in [(0x04, 2), (0x08, 1), (0x10, 5)] {
            let written = watchdog.write(offset, value, &mut context);
            assert_eq!(written, Err(Unmodelled), "{offset}");
        }
        assert_eq!(watchdog.read(0x0c, &mut context), Ok(0));
    }
}
