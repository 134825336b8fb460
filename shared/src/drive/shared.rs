//! State that every mode uses and none owns: protection, current offsets, faults, applied duties.

use siskin_params::{Delay, Shunts};
use siskin_units::math::Held;
use siskin_units::{AdcCounts, Duty, Speed, Voltage, traced};

use super::config::{ATTEMPTS, Config, Direction, QUICK_ATTEMPTS};
use super::io::{Rotation, Sample, Setpoint};
use super::phase::Phase;
use super::seen::Seen;
use super::transitions::Why;
use crate::control::modulator::Supply;
use crate::control::sensing;
use crate::protection::{self, Fault, Faults};

traced! {
    /// State that every mode uses.
    #[derive(Clone, Debug, PartialEq)]
    pub(super) struct Shared {
        pub(super) seen: Seen,
        pub(super) latch: Latch,
        /// The motor turns, or is to turn, against the configured direction.
        pub(super) reversed: bool,
        /// Failed attempts of a start.
        pub(super) failed_starts: u8,
        /// The present attempt has begun with a rotor that something turned against the demand.
        pub(super) against: bool,
        pub(super) progress: Progress,
        pub(super) protection: protection::State,
        /// Current offsets.
        pub(super) zeros: sensing::State,
        /// The phase currents for monitoring a turning motor: from the last sample, or with six-step from the end
        /// of the last sextant with a crossing.
        pub(super) shown: [AdcCounts; 3],
        pub(super) applied: Applied,
        /// The supply voltage and the vectors it allows.
        pub(super) supply: Supply,
    }
}

traced! {
    /// Faults that hold the bridge off.
    #[derive(Clone, Debug, PartialEq)]
    pub(super) struct Latch {
        pub(super) faults: Faults,
        /// Faults that turned the bridge off.
        pub(super) count: u32,
        /// The last of them, and the phase that it ended.
        pub(super) last: (Fault, Phase),
        /// Periods after which a fault ends for the next retry; 0 if there is none.
        pub(super) retry_periods: u32,
        /// Quick attempts that are left.
        pub(super) quick_attempts: u8,
        /// Periods since the last sample that was a fault, for which it has been on its way to its end.
        clear_periods: u32,
    }
}

traced! {
    /// Progress of a start and of a drive, in periods.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub(super) struct Progress {
        /// Periods for which Run has been slow.
        pub(super) slow_periods: u32,
        /// Periods since Run began, as far as they matter.
        pub(super) run_periods: u32,
        /// Consecutive periods with the observer's state out of range.
        pub(super) lost_periods: u32,
    }
}

traced! {
    /// Duties of the last commands, and whether all phases can be read.
    #[derive(Clone, Debug, PartialEq)]
    pub(super) struct Applied {
        /// The last two commands' duties of phases a, b, c, latest first. The second is maintained only while a
        /// phase may be unreadable.
        duties: [[Duty; 3]; 2],
        /// Samples for which a phase may be unreadable.
        unreadable: u8,
    }
}

/// Samples after a long voltage vector in which its duties may still matter.
const UNREADABLE: u8 = 3;

/// Ratio of a retry's pause to the previous one.
const LONGER: u32 = 4;

/// Ratio of the last retry's pause to the first: there are three.
const LAST_PAUSE: u32 = LONGER * LONGER;

impl Shared {
    /// Creates the power-up state.
    pub(super) fn new(config: &Config) -> Self {
        Self {
            seen: Seen::NOTHING,
            latch: Latch {
                faults: Faults::NONE,
                count: 0,
                last: (Fault::OverCurrent, Phase::Idle),
                retry_periods: 0,
                quick_attempts: 0,
                clear_periods: 0,
            },
            reversed: false,
            failed_starts: 0,
            against: false,
            progress: Progress::default(),
            protection: protection::State::new(&config.protection),
            zeros: sensing::State::default(),
            shown: [AdcCounts::ZERO; 3],
            applied: Applied {
                duties: [[Duty::ZERO; 3]; 2],
                unreadable: UNREADABLE,
            },
            supply: Supply::new(&config.modulator, Voltage::ZERO, Voltage::ZERO),
        }
    }

    /// A motor has turned long enough: whatever stops it now, it is to turn again.
    #[cold]
    #[inline(never)] // two callers
    pub(super) fn start_succeeded(&mut self, config: &Config) {
        self.failed_starts = 0;
        self.against = false;
        self.latch.retry_periods = config.retry_periods;
        // With sensors, or the six-step drive, an attempt takes too long.
        if config.slow_periods == 0 && config.retry_periods > 0 && config.six_step.is_none() {
            self.latch.quick_attempts = QUICK_ATTEMPTS;
        }
    }

    /// A start has failed, or the motor has become too slow: the next attempt, if there is one.
    #[cold]
    #[inline(never)] // one copy for both drives
    pub(super) fn start_failed(&mut self) -> Why {
        if self.against {
            // A rotor that turns is not stuck: once what turns it is weaker, the next attempt succeeds.
            // Another number each time, which tells of it.
            self.failed_starts = self.failed_starts % (ATTEMPTS as u8 - 1) + 1;
            return Why::Failed;
        }
        let quick = &mut self.latch.quick_attempts;
        if *quick > 0 {
            *quick -= 1;
            // Counted once, and then the first attempt of a start is skipped: it has less current than these.
            self.failed_starts = 1;
            return Why::Failed;
        }
        self.failed_starts += 1;
        if usize::from(self.failed_starts) >= ATTEMPTS {
            Why::Tripped(Fault::Stuck)
        } else {
            Why::Failed
        }
    }

    /// Returns a sample's currents.
    #[inline(always)] // in each period
    pub(super) fn currents(&mut self, config: &Config, sample: &Sample) -> [AdcCounts; 3] {
        if self.applied.unreadable != 0 {
            // One by one: an array that may come in memory would be in memory in every period.
            let [a, b, c] = self.reconstructed(config, sample);
            return [a, b, c];
        }
        sensing::read(&self.zeros, sample.currents)
    }

    /// Returns a sample's currents when a phase may be unreadable.
    #[cold]
    fn reconstructed(&mut self, config: &Config, sample: &Sample) -> [AdcCounts; 3] {
        let Applied { duties, unreadable } = &mut self.applied;
        // With two shunts the third phase never is.
        if config.sensing.shunts == Shunts::Three {
            *unreadable -= 1;
        }
        let elapsed = duties[usize::from(config.delay == Delay::One)];
        duties[1] = duties[0];
        sensing::currents(&config.sensing, &self.zeros, sample.currents, elapsed)
    }

    /// Returns true if phases b and c are swapped for the control, which always turns one way.
    #[inline(always)] // in each period
    pub(super) fn swapped(&self, config: &Config) -> bool {
        (config.direction == Direction::Reversed) != self.reversed
    }

    /// Returns true if a set-point wants the motor to turn the way it does, or is being started.
    #[inline(never)] // three callers
    pub(super) fn is_along(&self, config: &Config, setpoint: &Setpoint) -> bool {
        let present = if self.reversed {
            Rotation::Backward
        } else {
            Rotation::Forward
        };
        setpoint.rotation(config.both_ways) == present
    }

    /// Until something tells the shaft's speed, what is reported falls as slowly as a large propeller
    /// coasts.
    pub(super) fn coast(&mut self, config: &Config) {
        let speed = &mut self.seen.speed;
        let lost = config.coast.apply(*speed) + Speed::DELTA;
        *speed = speed.minus(lost).max(Speed::ZERO);
    }
}

impl Latch {
    /// Notes a fault in this phase; returns false if already noted, with the bridge off for it.
    pub(super) fn note(&mut self, fault: Fault, phase: Phase) -> bool {
        self.clear_periods = 0;
        if !fault.is_retried() {
            self.retry_periods = 0;
        }
        let known = self.faults.contains(fault);
        if !known {
            self.count = self.count.saturating_add(1);
            self.last = (fault, phase);
            self.faults.insert(fault);
        }
        !known || phase != Phase::Idle
    }

    /// Ends all retries: the flight is over.
    pub(super) fn forget_flight(&mut self) {
        self.retry_periods = 0;
        self.quick_attempts = 0;
    }

    /// A fault ends when zero throttle has stood for a while without its cause: the tasks have seen it
    /// by then, and a grazed limit does not come and go. Under open throttle it ends for a retry, if one is left:
    /// the first comes after a pause, each further one after a longer one.
    pub(super) fn clear(&mut self, config: &Config, setpoint: &Setpoint) {
        if matches!(setpoint, Setpoint::Stop | Setpoint::Zero) {
            self.forget_flight();
        }
        let periods = if *setpoint == Setpoint::Zero {
            config.clear_periods
        } else {
            self.retry_periods
        };
        if periods == 0 {
            self.clear_periods = 0;
        } else if self.clear_periods < periods {
            self.clear_periods += 1;
        } else {
            self.faults = Faults::NONE;
            self.retry_periods = if periods < config.retry_periods * LAST_PAUSE {
                self.retry_periods * LONGER
            } else {
                0
            };
        }
    }
}

impl Applied {
    /// Records the duties of a command.
    #[inline(always)] // in each period
    pub(super) fn command(&mut self, duties: [Duty; 3]) {
        self.duties[0] = duties;
    }

    /// Records that no phase switches.
    pub(super) fn rest(&mut self) {
        self.command([Duty::ZERO; 3]);
    }

    /// Clears the duties: the bridge has been off long enough.
    pub(super) fn forget(&mut self) {
        self.duties = [[Duty::ZERO; 3]; 2];
    }

    /// Returns true if the next command may leave a phase unreadable.
    #[inline(always)] // in each period
    pub(super) fn may_be_unreadable(&self) -> bool {
        self.unreadable == UNREADABLE
    }

    /// Returns true while duties are to be recorded.
    pub(super) fn may_matter(&self) -> bool {
        self.unreadable != 0
    }

    /// Notes that the next command may leave a phase unreadable.
    pub(super) fn expect_unreadable(&mut self) {
        if self.unreadable == 0 {
            // Nobody has used the second since.
            self.duties[1] = self.duties[0];
        }
        self.unreadable = UNREADABLE;
    }
}
