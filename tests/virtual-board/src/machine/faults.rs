//! Faults of the bench, the wire and the chip, by a scenario's timeline.

use siskin_emulator::fault::CHIP_V;
use siskin_emulator::machine::Stopped;

use super::VirtualBoard;
use crate::chip::Cause;

/// How often steady changes, and a supply that may be too low for the chip, are checked, ns.
const STEP_NS: u64 = 50_000;

impl VirtualBoard {
    /// Runs until a time, applying the faults of each moment.
    pub(super) fn play(&mut self, until_ns: u64) -> Result<(), Stopped> {
        while self.now_ns < until_ns {
            let now_s = self.now_ns as f64 * 1e-9;
            if now_s >= self.faults.due_s || self.faults.now.bus_weakened {
                self.disturb(now_s);
            }
            let step_ns = self.now_ns + STEP_NS;
            let due_ns = (self.faults.due_s * 1e9).ceil() as u64;
            let due_ns = if self.faults.now.bus_weakened {
                step_ns
            } else {
                due_ns.max(step_ns)
            };
            let next_ns = until_ns.min(due_ns);
            self.run(next_ns)?;
            self.now_ns = next_ns;
        }
        Ok(())
    }

    #[cold]
    fn disturb(&mut self, now_s: f64) {
        let before = self.faults.look(now_s);
        let now = self.faults.now;
        self.wire.disturb(now.wire);
        let world = self.processor.surroundings();
        // The chip's own comparators react.
        world.bench().disturb(&before, &now);
        world.parts().flash.fail(now.flash_fails);
        let starved = now.bus_weakened && world.bench().bus_v() < CHIP_V;
        if self.starved && !starved {
            self.reset(Cause::Power);
        } else if now.resets > before.resets || starved && !self.starved {
            self.reset(Cause::Pin);
        }
        self.starved = starved;
        self.held = now.held || starved;
    }
}
