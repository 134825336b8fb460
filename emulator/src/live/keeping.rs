//! Checks that simulated time keeps up with wall time, for senders that run on wall time: each second is checked once
//! over.

use std::time::Duration;

use super::pace::Pace;

/// The span of one check.
const LOOK: Duration = Duration::from_secs(1);

/// The same message is repeated no sooner.
const AGAIN: Duration = Duration::from_secs(60);

/// Share of the requested speed below which simulated time has fallen behind.
const BEHIND: f64 = 0.95;

/// Interval between two frames that no throttle signal exceeds, in simulated s: servo pulses come at 50 Hz.
const APART_S: f64 = 0.025;

/// Watches both clocks and the wire.
pub(super) struct Keeping {
    pace: Pace,
    /// At the latest look: wall time, simulated ns, and datagrams played.
    last: (Duration, u64, u64),
    told: Option<Duration>,
}

impl Keeping {
    pub(super) fn new(pace: Pace) -> Self {
        Self {
            pace,
            last: (Duration::ZERO, 0, 0),
            told: None,
        }
    }

    /// Looks, if it is time; returns a line if a sender will not get what it expects.
    pub(super) fn look(&mut self, wall: Duration, now_ns: u64, played: u64) -> Option<String> {
        let (since, since_ns, played_before) = self.last;
        let took = wall.checked_sub(since).filter(|took| *took >= LOOK)?;
        self.last = (wall, now_ns, played);
        let simulated_s = (now_ns - since_ns) as f64 * 1e-9;
        let rate = simulated_s / took.as_secs_f64();
        let apart_s = simulated_s / (played - played_before) as f64;
        let line = match self.pace {
            Pace::Times(times) if rate < BEHIND * times => format!(
                "simulated time passes at {:.2} of the speed asked for, since this machine is too slow for \
                 it now: all that the ESC waits for, such as zero throttle before it arms, takes a sender \
                 {:.1} times as long, and a throttle that opens before that turns nothing",
                rate / times,
                times / rate.max(1e-3),
            ),
            // Without a frame they are infinitely far apart: nobody sends.
            _ if rate > 1.0 && (APART_S..f64::INFINITY).contains(&apart_s) => format!(
                "simulated time passes {rate:.0} times as fast as the sender's, so that frames on the throttle \
                 wire come {:.0} ms apart, which the ESC takes for a lost signal: give --speed 1, or play a \
                 scenario",
                1e3 * apart_s,
            ),
            _ => return None,
        };
        if self.told.is_some_and(|told| wall - told < AGAIN) {
            return None;
        }
        self.told = Some(wall);
        Some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    fn wall(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    #[test]
    fn a_machine_that_is_too_slow_is_told_once_a_minute() {
        let mut keeping = Keeping::new(Pace::Times(1.0));
        assert_eq!(keeping.look(wall(0.9), S / 2, 0), None);
        assert_eq!(keeping.look(wall(1.0), S, 0), None);
        let line = keeping.look(wall(2.0), S + 6 * S / 10, 0).unwrap();
        assert!(line.contains("at 0.60 of the speed asked for"), "{line}");
        assert!(line.contains("1.7 times as long"), "{line}");
        assert_eq!(keeping.look(wall(3.0), 2 * S, 0), None);
        assert!(keeping.look(wall(62.0), 3 * S, 0).is_some());
    }

    #[test]
    fn slow_motion_that_was_asked_for_is_nothing_to_tell() {
        let mut keeping = Keeping::new(Pace::Times(0.1));
        assert_eq!(keeping.look(wall(1.0), S / 10, 1000), None);
    }

    #[test]
    fn a_sender_that_simulated_time_outruns_is_told() {
        let mut keeping = Keeping::new(Pace::Max);
        // Nobody sends; then 1000 frames in 90 simulated seconds.
        assert_eq!(keeping.look(wall(1.0), 100 * S, 0), None);
        let line = keeping.look(wall(2.0), 190 * S, 1000).unwrap();
        assert!(line.contains("come 90 ms apart"), "{line}");
        // Servo pulses of 50 Hz, as slow as a real one.
        let mut keeping = Keeping::new(Pace::Times(1.0));
        assert_eq!(keeping.look(wall(1.0), S, 50), None);
    }
}
