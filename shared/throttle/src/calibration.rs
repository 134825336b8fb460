//! Stick calibration of the pulse end points.
//!
//! It works as on other ESCs: power up (a mere reset does not do) with the stick at full throttle, and after two seconds
//! the ESC reports that it has measured it; pull the stick to no throttle, and after one and a half seconds both ends
//! are known. Anything else leaves them as they were until the next power-up.
//!
//! A ground station may request the same at any time; the stick then has a minute to come up.
//!
//! Repeating the sequence right after one from power-up, with the stick up within two seconds, requests
//! identification of the motor.

use siskin_units::math::quotient;

use super::endpoints::EndPoints;

/// Servo pulses accepted as full throttle, ns: what transmitters and flight controllers send at that end, 1900 to 2020
/// µs, with a margin. A stick that is merely high, or the centre of a two-direction one, must not start a calibration.
const FULL_NS: core::ops::RangeInclusive<u32> = 1_850_000..=2_200_000;
/// Servo pulses accepted as no throttle, ns.
const NONE_NS: core::ops::RangeInclusive<u32> = 800_000..=1_300_000;

/// How long full throttle must be held, µs. PX4 holds it for 3.00 to 3.05 s from battery connection, ArduPilot
/// for 5 s; the ESC's startup and signal identification take 0.1 s each out of that.
const FULL_US: u64 = 2_200_000;
/// How long no throttle must be held, µs.
const NONE_US: u64 = 1_500_000;
/// The most a held stick may stray from its first width, ns; receivers jitter by a few µs.
const STEADY_NS: u32 = 16_000;
/// The longest time for the stick to travel from one end to the other, µs.
const WAY_US: u64 = 2_000_000;
/// How long to wait for the stick after a ground station's request, µs.
const WAIT_US: u64 = 60_000_000;

/// A calibration step to report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Full throttle measured; waiting for no throttle.
    Full,
    /// Both ends measured.
    Done(EndPoints),
    /// Full throttle held again; waiting for no throttle.
    Again,
    /// No throttle followed: identify the motor.
    Identify,
    /// Something other than no throttle followed full throttle, or the stick did not move as asked.
    Cancelled,
}

/// Watches the first signal after power-up, and any later one on request.
#[derive(Clone, Debug, Default)]
pub struct Calibration {
    stage: Stage,
    /// When it was requested, until it ends.
    asked_us: Option<u64>,
    /// Both ends are measured: the stick may now request identification.
    done: bool,
}

#[derive(Clone, Copy, Debug, Default)]
enum Stage {
    /// No pulse yet.
    #[default]
    Fresh,
    /// The stick is at full throttle.
    Full(Held),
    /// Full throttle is measured.
    None {
        full_ns: u32,
        /// When the stick was last at full throttle.
        full_us: u64,
        held: Option<Held>,
    },
    Over,
}

/// A stick held in one position.
#[derive(Clone, Copy, Debug)]
struct Held {
    since_us: u64,
    first_ns: u32,
    /// Sum of the deviations from the first width.
    sum_ns: i64,
    count: u32,
}

impl Calibration {
    /// Starts a calibration: waits for the stick at full throttle.
    pub fn ask(&mut self, now_us: u64) {
        *self = Self {
            asked_us: Some(now_us),
            ..Self::default()
        };
    }

    /// Ends the calibration: the signal is not pulses, or it is no longer wanted. Never inlined, because every
    /// exit calls it.
    #[inline(never)]
    pub fn end(&mut self) -> Option<Step> {
        let cancels = self.is_under_way() && !self.done;
        *self = Self {
            stage: Stage::Over,
            ..Self::default()
        };
        cancels.then_some(Step::Cancelled)
    }

    /// Returns true while the stick calibrates and is not throttle: a calibration was requested, or full
    /// throttle is measured and no throttle is still to come.
    pub fn is_under_way(&self) -> bool {
        self.asked_us.is_some() || matches!(self.stage, Stage::None { .. })
    }

    /// Ends the calibration when an identified signal, if any, is lost.
    pub fn lost(&mut self) -> Option<Step> {
        match (&self.stage, self.asked_us) {
            (Stage::Fresh, None) => None,
            _ => self.end(),
        }
    }

    /// Times out when the stick does not come up.
    pub fn poll(&mut self, now_us: u64) -> Option<Step> {
        let waits = matches!(self.stage, Stage::Fresh);
        let asked_us = self.asked_us.filter(|_| waits)?;
        let most_us = if self.done { WAY_US } else { WAIT_US };
        (now_us.saturating_sub(asked_us) > most_us)
            .then(|| self.end())
            .flatten()
    }

    /// Processes a pulse of an identified signal, converted to the equivalent servo pulse.
    pub fn pulse(&mut self, now_us: u64, servo_ns: u32) -> Option<Step> {
        let full = FULL_NS.contains(&servo_ns);
        match &mut self.stage {
            Stage::Fresh if full => self.stage = Stage::Full(Held::new(now_us, servo_ns)),
            Stage::Full(held) if full => {
                held.add(now_us, servo_ns);
                if held.for_us(now_us) >= FULL_US {
                    self.stage = Stage::None {
                        full_ns: held.mean_ns(),
                        full_us: now_us,
                        held: None,
                    };
                    return Some(if self.done { Step::Again } else { Step::Full });
                }
            }
            Stage::Fresh | Stage::Full(_) if self.asked_us.is_some() => self.stage = Stage::Fresh,
            Stage::Fresh | Stage::Full(_) => return self.end(),
            Stage::None {
                full_ns,
                full_us,
                held,
            } => {
                if full {
                    *full_us = now_us;
                    *held = None;
                    return None;
                }
                if NONE_NS.contains(&servo_ns) {
                    let held = held.get_or_insert(Held::new(now_us, servo_ns));
                    held.add(now_us, servo_ns);
                    if held.for_us(now_us) >= NONE_US {
                        let ends = EndPoints {
                            min_us: whole_us(held.mean_ns()),
                            max_us: whole_us(*full_ns),
                        };
                        let (again, asked) = (self.done, self.asked_us.is_some());
                        self.end();
                        if again {
                            return Some(Step::Identify);
                        }
                        // With a ground station, identification is requested there.
                        if !asked {
                            self.ask(now_us);
                            self.done = true;
                        }
                        return Some(Step::Done(ends));
                    }
                } else {
                    *held = None;
                }
                if held.is_none() && now_us.saturating_sub(*full_us) > WAY_US {
                    return self.end();
                }
            }
            Stage::Over => {}
        }
        None
    }
}

impl Held {
    fn new(now_us: u64, width_ns: u32) -> Self {
        Self {
            since_us: now_us,
            first_ns: width_ns,
            sum_ns: 0,
            count: 0,
        }
    }

    /// Adds a pulse; a stick that moved starts over.
    fn add(&mut self, now_us: u64, width_ns: u32) {
        if self.first_ns.abs_diff(width_ns) > STEADY_NS {
            *self = Self::new(now_us, width_ns);
        }
        self.sum_ns += i64::from(width_ns) - i64::from(self.first_ns);
        self.count += 1;
    }

    fn for_us(&self, now_us: u64) -> u64 {
        now_us.saturating_sub(self.since_us)
    }

    fn mean_ns(&self) -> u32 {
        let mean_ns = quotient(self.sum_ns.unsigned_abs(), self.count.max(1));
        // The mean deviates from the first width no more than any single width does.
        if self.sum_ns < 0 {
            self.first_ns.saturating_sub(mean_ns)
        } else {
            self.first_ns.saturating_add(mean_ns)
        }
    }
}

/// Rounds to the nearest µs.
fn whole_us(ns: u32) -> u16 {
    ((ns + 500) / 1000) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// A calibration, a clock, and pulses every 20 ms.
    #[derive(Default)]
    struct Bench {
        calibration: Calibration,
        now_us: u64,
    }

    impl Bench {
        /// Returns the reported steps, each with the ms since the first of these pulses.
        fn hold(&mut self, ms: u64, width_us: impl Fn(u64) -> u32) -> Vec<(u64, Step)> {
            let mut steps = Vec::new();
            for pulse in 0..ms / 20 {
                let step = self.calibration.pulse(self.now_us, width_us(pulse) * 1000);
                steps.extend(step.map(|step| (pulse * 20, step)));
                self.now_us += 20_000;
            }
            steps
        }
    }

    const DONE: Step = Step::Done(EndPoints {
        min_us: 1105,
        max_us: 1912,
    });

    #[test]
    fn full_throttle_for_2_2_s_then_low_for_one_and_a_half_is_taken() {
        let mut bench = Bench::default();
        assert_eq!(bench.hold(5_000, |_| 1912), [(2_200, Step::Full)]);
        assert_eq!(bench.hold(400, |n| 1900 - n as u32 * 40), []);
        assert_eq!(bench.hold(2_000, |_| 1105), [(1_500, DONE)]);
        // Once: two seconds later nothing is a calibration or a request any more.
        assert!(bench.calibration.is_under_way());
        bench.hold(1_600, |_| 1105);
        assert_eq!(bench.calibration.poll(bench.now_us), None);
        assert!(!bench.calibration.is_under_way());
        assert_eq!(bench.hold(5_000, |_| 1950), []);
        assert_eq!(bench.hold(5_000, |_| 1050), []);
    }

    #[test]
    fn the_same_once_more_asks_for_the_identification() {
        let taken = || {
            let mut bench = Bench::default();
            bench.hold(3_000, |_| 1912);
            assert_eq!(bench.hold(1_520, |_| 1105), [(1_500, DONE)]);
            bench
        };
        let mut bench = taken();
        assert_eq!(bench.hold(1_000, |_| 1105), []);
        assert_eq!(bench.hold(3_000, |_| 1912), [(2_200, Step::Again)]);
        assert_eq!(bench.hold(400, |n| 1900 - n as u32 * 40), []);
        assert_eq!(bench.hold(2_000, |_| 1105), [(1_500, Step::Identify)]);
        assert!(!bench.calibration.is_under_way());
        assert_eq!(bench.hold(5_000, |_| 1912), []);

        // Too short, left in the middle, and a lost signal: nothing is requested, and the ends are kept.
        let mut bench = taken();
        bench.hold(2_000, |_| 1912);
        bench.hold(20, |_| 1105);
        assert_eq!(bench.calibration.poll(bench.now_us), None);
        assert_eq!(bench.hold(5_000, |_| 1105), []);
        let mut bench = taken();
        assert_eq!(bench.hold(3_000, |_| 1912), [(2_200, Step::Again)]);
        assert_eq!(bench.hold(5_000, |_| 1500), []);
        assert_eq!(bench.hold(5_000, |_| 1105), []);
        let mut bench = taken();
        assert_eq!(bench.hold(3_000, |_| 1912), [(2_200, Step::Again)]);
        assert_eq!(bench.calibration.lost(), None);
        assert_eq!(bench.hold(5_000, |_| 1105), []);
    }

    #[test]
    fn the_mean_is_taken_of_what_jitters() {
        let mut bench = Bench::default();
        let jitter = |n: u64| (n % 7) as u32 * 2;
        assert_eq!(
            bench.hold(3_020, |n| 1906 + jitter(n)),
            [(2_200, Step::Full)]
        );
        assert_eq!(bench.hold(1_520, |n| 1099 + jitter(n)), [(1_500, DONE)]);
    }

    #[test]
    fn a_stick_that_moves_at_its_end_is_waited_for() {
        let mut bench = Bench::default();
        assert_eq!(bench.hold(2_900, |n| 1860 + n as u32), []);
        assert_eq!(bench.hold(3_020, |_| 1912), [(2_200, Step::Full)]);
        assert_eq!(bench.hold(1_400, |_| 1200), []);
        assert_eq!(bench.hold(1_520, |_| 1105), [(1_500, DONE)]);
    }

    #[test]
    fn anything_else_at_first_is_no_calibration() {
        for first_us in [700, 1000, 1500, 1849, 2201] {
            let mut bench = Bench::default();
            bench.hold(20, |_| first_us);
            assert_eq!(bench.hold(5_000, |_| 1912), []);
            assert_eq!(bench.hold(5_000, |_| 1105), []);
        }
        // High, but lowered too early.
        let mut bench = Bench::default();
        bench.hold(2_180, |_| 1912);
        assert_eq!(bench.hold(5_000, |_| 1105), []);
        assert_eq!(bench.hold(5_000, |_| 1912), []);
    }

    #[test]
    fn the_middle_cancels() {
        for rest_us in [1500, 1301, 799] {
            let mut bench = Bench::default();
            bench.hold(3_020, |_| 1912);
            let steps = bench.hold(9_000, |_| rest_us);
            assert_eq!(steps, [(2_000, Step::Cancelled)], "{rest_us}");
            assert_eq!(bench.hold(5_000, |_| 1105), []);
        }
    }

    #[test]
    fn one_that_is_asked_for_waits_for_the_stick() {
        let mut bench = Bench::default();
        // After the first signal, which did not calibrate.
        bench.hold(1_000, |_| 1105);
        bench.calibration.ask(bench.now_us);
        assert!(bench.calibration.is_under_way());
        assert_eq!(bench.hold(5_000, |_| 1105), []);
        // Lowered too early: once more.
        assert_eq!(bench.hold(2_000, |_| 1912), []);
        assert_eq!(bench.hold(1_000, |_| 1105), []);
        assert_eq!(bench.hold(3_020, |_| 1912), [(2_200, Step::Full)]);
        assert_eq!(bench.hold(1_520, |_| 1105), [(1_500, DONE)]);
        assert!(!bench.calibration.is_under_way());

        // A stick that stays low times out after a minute; one that comes up is taken.
        for (up_ms, ended) in [(0, Some(Step::Cancelled)), (1_000, None)] {
            bench.calibration.ask(bench.now_us);
            assert_eq!(bench.hold(60_000, |_| 1105), []);
            assert_eq!(bench.calibration.poll(bench.now_us), None);
            bench.hold(up_ms, |_| 1912);
            bench.now_us += 1;
            assert_eq!(bench.calibration.poll(bench.now_us), ended);
            assert_eq!(bench.calibration.is_under_way(), ended.is_none());
        }
        assert_eq!(bench.calibration.lost(), Some(Step::Cancelled));
        assert_eq!(bench.calibration.end(), None);
    }

    #[test]
    fn a_lost_signal_cancels() {
        let mut bench = Bench::default();
        bench.hold(2_000, |_| 1912);
        assert_eq!(bench.calibration.lost(), None, "nothing was told yet");
        assert_eq!(bench.hold(9_000, |_| 1912), []);

        let mut bench = Bench::default();
        bench.hold(3_500, |_| 1912);
        bench.hold(1_000, |_| 1105);
        assert_eq!(bench.calibration.lost(), Some(Step::Cancelled));
        assert_eq!(bench.hold(9_000, |_| 1105), []);
    }
}
