//! DShot's commands: values 1 to 47.
//!
//! | value | meaning | in a row |
//! |---|---|---|
//! | 1 to 5 | beacon, with the motor as a loudspeaker | 1 |
//! | 6 | the ESC's information on the serial line | 1 |
//! | 7, 8 | direction 1 or 2: `MOT_DIR` 0 or 1 | 6, waits |
//! | 9, 10 | one or two throttle directions: `INP_3D` 0 or 1 | 6 |
//! | 12 | save the settings | 6, waits |
//! | 13, 14 | extended telemetry on, off | 6, at once |
//! | 20, 21 | turn as `MOT_DIR` says, or against it, until the next start | 6, waits |
//! | 22, 26 | the light on, off | 1 |
//! | 31 | silent mode on, off: no tunes but beacons | 6 |
//!
//! All others are accepted, ignored, and count as zero throttle, as these do: 11 asks for settings in an
//! unpublished format, 23 to 25 and 27 to 29 are for lights that no board here has, 30 is an audio stream, 32
//! to 35 switch a telemetry that bidirectional DShot has replaced, and the rest is undefined.
//!
//! A command counts at zero throttle. Extended telemetry switches at once even while the motor turns:
//! Betaflight requests it at each arming, and a pilot may rearm before the propeller has stopped. A direction,
//! and the save after it, wait until the motor stands, as long as the wire stays at zero: Betaflight's
//! configurator sends them 400 ms after a stop, and a coasting motor takes longer. Within 100 ms of throttle
//! they are ignored, as they are under throttle. All others are obeyed only while the motor stands.
//!
//! A command is obeyed once, however often it repeats: flight controllers send most of them ten times. A single
//! bad frame in the row, or before it, does not break it: when a flight controller boots, the rise of the line
//! spoils one. Two bad frames in succession do.
//!
//! A command that counts at once may be another frame with errors that its checksum missed. Just after a bad
//! frame, and for longer after two within half a second, it therefore needs six in a row like the rest. Flight
//! controllers send a beacon once, and an occasional bad frame must not silence all of them. On any other wire
//! a single frame with undetected errors can still sound a beacon, send the information or switch the light; of
//! random words one in 4096 does. Commands that change something always take six.

use super::dshot::Frame;

/// Consecutive frames needed for a command that changes something.
const REPEATS: u8 = 6;

/// How long after a bad frame a single frame is not proof enough, µs.
const DOUBT_US: u64 = 50_000;
/// The same after two bad frames, µs.
const DOUBT_OF_TWO_US: u64 = 1_000_000;
/// The longest time between those two, µs.
const BAD_APART_US: u64 = 500_000;

/// How long the wire must be at zero throttle before a command may wait for a motor that still turns, µs.
const SETTLED_US: u64 = 100_000;

/// The minimum time between two beacons, as flight controllers leave it too, µs.
const BEACON_APART_US: u64 = 260_000;

/// The five beacons, DShot commands 1 to 5: each higher than the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beacon {
    /// Command 1.
    One,
    /// Command 2.
    Two,
    /// Command 3.
    Three,
    /// Command 4.
    Four,
    /// Command 5.
    Five,
}

/// What a command orders.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Sound a beacon.
    Beacon(Beacon),
    /// Send the ESC's information on the serial line.
    Info,
    /// Set `MOT_DIR`, to 1 if reversed.
    Direction {
        /// True for the other direction.
        reversed: bool,
    },
    /// Set `INP_3D`.
    TwoDirections(bool),
    /// Store the parameters.
    Save,
    /// Turn extended telemetry on or off.
    Extended(bool),
    /// Turn as `MOT_DIR` says or against it, until the next start.
    Spin {
        /// True if it is against `MOT_DIR`.
        opposite: bool,
    },
    /// Turn the light on or off.
    Light(bool),
    /// Turn tunes off, or on again.
    Silent,
}

impl Order {
    /// Returns the order that a value gives, if any.
    pub fn of(value: u16) -> Option<Self> {
        Some(match value {
            1 => Self::Beacon(Beacon::One),
            2 => Self::Beacon(Beacon::Two),
            3 => Self::Beacon(Beacon::Three),
            4 => Self::Beacon(Beacon::Four),
            5 => Self::Beacon(Beacon::Five),
            6 => Self::Info,
            7 => Self::Direction { reversed: false },
            8 => Self::Direction { reversed: true },
            9 => Self::TwoDirections(false),
            10 => Self::TwoDirections(true),
            12 => Self::Save,
            13 => Self::Extended(true),
            14 => Self::Extended(false),
            20 => Self::Spin { opposite: false },
            21 => Self::Spin { opposite: true },
            22 => Self::Light(true),
            26 => Self::Light(false),
            31 => Self::Silent,
            _ => return None,
        })
    }

    /// Returns true if an order given earlier waits until the motor stands.
    pub fn waits(self) -> bool {
        matches!(
            self,
            Self::Direction { .. } | Self::Spin { .. } | Self::Save
        )
    }

    /// Returns true if the order may be given now: the motor stands, or the wire has been at zero throttle for
    /// long enough, `zero_us`.
    pub(super) fn is_in_time(self, stopped: bool, zero_us: u64) -> bool {
        stopped || matches!(self, Self::Extended(_)) || self.waits() && zero_us >= SETTLED_US
    }

    /// Returns how many consecutive frames it takes. One suffices if its effect ends by itself or is only
    /// visible.
    fn repeats(self) -> u8 {
        match self {
            Self::Beacon(_) | Self::Info | Self::Light(_) => 1,
            _ => REPEATS,
        }
    }
}

/// Returns how many consecutive frames the command of this value takes without recent bad frames, or `None` if
/// it is ignored.
pub fn repeats(value: u16) -> Option<u8> {
    Order::of(value).map(Order::repeats)
}

/// Counts repeated commands.
#[derive(Clone, Debug, Default)]
pub struct Commands {
    value: u16,
    /// Consecutive valid frames with this value, up to [`REPEATS`].
    count: u8,
    /// This row has been obeyed already.
    done: bool,
    /// The last frame was bad.
    spoilt: bool,
    bad_us: Option<u64>,
    /// Another bad frame came shortly before that one.
    doubted: bool,
    beacon_us: Option<u64>,
}

impl Commands {
    /// Processes a valid frame while commands may be given. The telemetry bit makes no difference.
    pub fn frame(&mut self, now_us: u64, frame: Frame) -> Option<Order> {
        if frame.value != self.value {
            self.interrupt();
            self.value = frame.value;
        }
        self.spoilt = false;
        self.count = REPEATS.min(self.count + 1);
        let order = Order::of(frame.value)?;
        let doubt_us = if self.doubted {
            DOUBT_OF_TWO_US
        } else {
            DOUBT_US
        };
        let doubted = within(now_us, self.bad_us, doubt_us);
        let enough = if doubted { REPEATS } else { order.repeats() };
        if self.done || self.count < enough {
            return None;
        }
        self.done = true;
        if matches!(order, Order::Beacon(_)) {
            if within(now_us, self.beacon_us, BEACON_APART_US - 1) {
                return None;
            }
            self.beacon_us = Some(now_us);
        }
        Some(order)
    }

    /// Records a bad frame. A second one in succession restarts the count.
    pub fn bad(&mut self, now_us: u64) {
        self.doubted = within(now_us, self.bad_us, BAD_APART_US);
        self.bad_us = Some(now_us);
        if core::mem::replace(&mut self.spoilt, true) {
            self.count = 0;
        }
    }

    /// Forgets the row: the signal was lost, or the value is not a command now.
    pub fn interrupt(&mut self) {
        self.value = 0;
        self.count = 0;
        self.done = false;
    }
}

/// Returns true if at most `most_us` have passed since `since_us`.
pub(super) fn within(now_us: u64, since_us: Option<u64>, most_us: u64) -> bool {
    since_us.is_some_and(|since_us| now_us.saturating_sub(since_us) <= most_us)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Commands, a clock, and frames 1 ms apart.
    struct Bench {
        commands: Commands,
        now_us: u64,
    }

    impl Bench {
        fn new() -> Self {
            Self {
                commands: Commands::default(),
                now_us: 5_000_000,
            }
        }

        /// Returns the orders, each with the frame that gave it, counted from 1.
        fn play(&mut self, count: usize, value: u16) -> Vec<(usize, Order)> {
            let mut orders = Vec::new();
            for number in 1..=count {
                self.now_us += 1_000;
                let frame = Frame {
                    value,
                    telemetry: number % 2 == 0,
                };
                let order = self.commands.frame(self.now_us, frame);
                orders.extend(order.map(|order| (number, order)));
            }
            orders
        }

        fn bad(&mut self) {
            self.now_us += 1_000;
            self.commands.bad(self.now_us);
        }
    }

    /// Every value with a meaning, and how many frames it takes.
    const MEANT: [(u16, usize, Order); 18] = [
        (1, 1, Order::Beacon(Beacon::One)),
        (2, 1, Order::Beacon(Beacon::Two)),
        (3, 1, Order::Beacon(Beacon::Three)),
        (4, 1, Order::Beacon(Beacon::Four)),
        (5, 1, Order::Beacon(Beacon::Five)),
        (6, 1, Order::Info),
        (7, 6, Order::Direction { reversed: false }),
        (8, 6, Order::Direction { reversed: true }),
        (9, 6, Order::TwoDirections(false)),
        (10, 6, Order::TwoDirections(true)),
        (12, 6, Order::Save),
        (13, 6, Order::Extended(true)),
        (14, 6, Order::Extended(false)),
        (20, 6, Order::Spin { opposite: false }),
        (21, 6, Order::Spin { opposite: true }),
        (22, 1, Order::Light(true)),
        (26, 1, Order::Light(false)),
        (31, 6, Order::Silent),
    ];

    #[test]
    fn each_command_is_obeyed_once_and_by_its_count() {
        for value in 0..=2047 {
            let meant = MEANT.iter().find(|(other, ..)| *other == value);
            let wanted: Vec<_> = meant
                .map(|(_, at, order)| (*at, *order))
                .into_iter()
                .collect();
            let count = repeats(value).map(usize::from);
            assert_eq!(count, meant.map(|(_, at, _)| *at), "{value}");
            let mut bench = Bench::new();
            assert_eq!(bench.play(10_000, value), wanted, "{value}");
            bench.now_us += 260_000;
            bench.play(1, 0);
            assert_eq!(bench.play(10, value), wanted, "{value} again");
        }
    }

    #[test]
    fn five_are_not_six() {
        for (value, frames, _) in MEANT.into_iter().filter(|(_, frames, _)| *frames == 6) {
            for between in [0, 11, 30, 48] {
                let mut bench = Bench::new();
                for _ in 0..100 {
                    assert_eq!(bench.play(frames - 1, value), [], "{value}");
                    assert_eq!(bench.play(1, between), [], "{value}, {between}");
                }
            }
        }
    }

    #[test]
    fn a_single_bad_frame_does_not_end_a_row_and_two_do() {
        let order = Order::Spin { opposite: true };
        for place in 0..6 {
            let mut bench = Bench::new();
            bench.play(place, 21);
            bench.bad();
            assert_eq!(bench.play(5 - place, 21), [], "{place}");
            assert_eq!(bench.play(1, 21), [(1, order)], "{place}");
        }
        let mut bench = Bench::new();
        for _ in 0..5 {
            assert_eq!(bench.play(1, 21), []);
            bench.bad();
        }
        assert_eq!(bench.play(1, 21), [(1, order)], "one between any two");

        let mut bench = Bench::new();
        assert_eq!(bench.play(5, 21), []);
        bench.bad();
        bench.bad();
        assert_eq!(bench.play(5, 21), []);
        assert_eq!(bench.play(1, 21), [(1, order)]);
        bench.bad();
        bench.bad();
        assert_eq!(bench.play(100, 21), [], "the same row");
    }

    #[test]
    fn one_bad_frame_now_and_then_does_not_silence_beacons() {
        let mut bench = Bench::new();
        for _ in 0..10 {
            bench.bad();
            bench.play(48, 0);
            assert_eq!(bench.play(1, 3), [], "just after");
            bench.play(351, 0);
            assert_eq!(bench.play(1, 3), [(1, Order::Beacon(Beacon::Three))]);
            bench.play(498, 0);
        }
    }

    #[test]
    fn for_a_second_after_two_bad_frames_a_beacon_takes_six() {
        let mut bench = Bench::new();
        bench.bad();
        bench.play(499, 0);
        bench.bad();
        assert_eq!(bench.play(5, 3), []);
        assert_eq!(bench.play(5, 3), [(1, Order::Beacon(Beacon::Three))]);
        bench.bad();
        bench.play(999, 0);
        assert_eq!(bench.play(1, 6), [], "a second");
        bench.play(1, 0);
        assert_eq!(bench.play(1, 6), [(1, Order::Info)], "longer");
    }

    #[test]
    fn beacons_are_260_ms_apart() {
        let mut bench = Bench::new();
        let mut beacons_us = Vec::new();
        for _ in 0..1_000 {
            bench.play(1, 0);
            if !bench.play(1, 1).is_empty() {
                beacons_us.push(bench.now_us);
            }
        }
        assert_eq!(beacons_us.len(), 8, "2 s");
        assert!(
            beacons_us
                .windows(2)
                .all(|pair| pair[1] - pair[0] == 260_000)
        );
    }

    #[test]
    fn what_was_interrupted_is_counted_anew() {
        let mut bench = Bench::new();
        bench.play(5, 12);
        bench.commands.interrupt();
        assert_eq!(bench.play(6, 12), [(6, Order::Save)]);
        bench.commands.interrupt();
        assert_eq!(bench.play(6, 12), [(6, Order::Save)]);
    }
}
