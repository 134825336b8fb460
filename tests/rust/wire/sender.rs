//! A throttle signal sender with the errors of a real one, and the listener on its line.

use siskin_throttle::dshot::{Rate, check_mask, edges};
use siskin_throttle::line::{Event, Line};
use siskin_throttle::signal::{Pulse, Signal};

/// The timers of the STM32G431 and the STM32F405.
pub(crate) const TICK_HZ: u32 = 170_000_000;
pub(crate) const SLOW_TICK_HZ: u32 = 84_000_000;

/// Control periods per second: how often the line is asked whether it has settled.
const SETTLE_HZ: u64 = 24_000;

const PS_PER_NS: u64 = 1_000;

/// Fraction bits of the ratio of the sender's time to true time.
const RATIO_PLACES: u32 = 32;

/// Splitmix64.
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut mixed = self.0;
        mixed = (mixed ^ mixed >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        mixed ^ mixed >> 31
    }

    /// Returns 0 to below `end`.
    pub(crate) fn below(&mut self, end: u64) -> u64 {
        // The upper half of the product: even to one part in 2³² or better, without a division.
        ((u128::from(self.next()) * u128::from(end)) >> 64) as u64
    }

    /// Returns `least` to below `end`.
    pub(crate) fn between(&mut self, least: u64, end: u64) -> u64 {
        least + self.below(end - least)
    }

    /// Returns true once in `times` calls, on average.
    pub(crate) fn once_in(&mut self, times: u64) -> bool {
        self.below(times) == 0
    }
}

/// What is wrong with a sender and its line.
#[derive(Clone, Copy, Default)]
pub(crate) struct Errors {
    /// How fast its clock is, parts per thousand.
    pub(crate) fast_permille: i64,
    /// Largest deviation of every edge, early or late, ns.
    pub(crate) jitter_ns: u64,
    /// Longest glitch, one of which interrupts every level, ns.
    pub(crate) glitch_ns: u64,
    /// Bits flipped per thousand.
    pub(crate) flipped_permille: u64,
}

/// Hears what is on the wire. Times are in ticks of a timer that does not wrap.
pub(crate) trait Listener {
    fn edge(&mut self, at_ticks: u64, level: bool) -> Option<Event>;
    fn settle(&mut self, now_ticks: u64) -> Option<Event>;
}

impl Listener for Line {
    fn edge(&mut self, at_ticks: u64, level: bool) -> Option<Event> {
        self.edge(at_ticks as u32, level)
    }

    fn settle(&mut self, now_ticks: u64) -> Option<Event> {
        self.settle(now_ticks as u32)
    }
}

/// A sender and its listener.
pub(crate) struct Wire<L> {
    pub(crate) listener: L,
    pub(crate) chance: Chance,
    pub(crate) errors: Errors,
    /// When the next signal begins, ps.
    pub(crate) now_ps: u64,
    /// What has been heard and not yet taken, and when, ticks.
    pub(crate) events: Vec<(u64, Event)>,
    tick_mhz: u64,
    settled_ticks: u64,
}

impl Wire<Line> {
    /// Creates a sender, and a decoder with a timer of `tick_hz`.
    pub(crate) fn to_line(tick_hz: u32, seed: u64) -> Self {
        Self::new(Line::new(tick_hz), tick_hz, seed)
    }
}

impl<L: Listener> Wire<L> {
    pub(crate) fn new(listener: L, tick_hz: u32, seed: u64) -> Self {
        Self {
            listener,
            chance: Chance(seed),
            errors: Errors::default(),
            now_ps: 0,
            events: Vec::new(),
            tick_mhz: u64::from(tick_hz / 1_000_000),
            settled_ticks: 0,
        }
    }

    /// Returns the count that the timer would have if it did not wrap.
    pub(crate) fn ticks(&self, at_ps: u64) -> u64 {
        at_ps * self.tick_mhz / 1_000_000
    }

    /// Converts a duration on the sender's clock to true time, ps.
    pub(crate) fn sent(&self, ps: u64) -> u64 {
        let thousand = 1000_u64.saturating_add_signed(self.errors.fast_permille);
        // The compiler turns a division by 1000 into a product, but not this one, so it is done once.
        let ratio = (1000 << RATIO_PLACES) / thousand;
        ((u128::from(ps) * u128::from(ratio)) >> RATIO_PLACES) as u64
    }

    /// Plays an edge at exactly this time.
    pub(crate) fn edge(&mut self, at_ps: u64, level: bool) {
        let ticks = self.ticks(at_ps);
        self.settle_until(ticks);
        let event = self.listener.edge(ticks, level);
        self.events.extend(event.map(|event| (ticks, event)));
    }

    /// Lets the line settle once per control period.
    fn settle_until(&mut self, ticks: u64) {
        let period = self.tick_mhz * 1_000_000 / SETTLE_HZ;
        while self.settled_ticks + period <= ticks {
            self.settled_ticks += period;
            let ticks = self.settled_ticks;
            let event = self.listener.settle(ticks);
            self.events.extend(event.map(|event| (ticks, event)));
        }
    }

    /// Lets the line settle at the current time.
    pub(crate) fn settle(&mut self) {
        let ticks = self.ticks(self.now_ps);
        self.settle_until(ticks);
        let event = self.listener.settle(ticks);
        self.events.extend(event.map(|event| (ticks, event)));
    }

    /// Sets the line to `level` at about this time, for `for_ps`.
    fn level(&mut self, at_ps: u64, level: bool, for_ps: u64) {
        let jitter_ps = self.errors.jitter_ns * PS_PER_NS;
        let strayed_ps = match jitter_ps {
            0 => at_ps,
            most => (at_ps + self.chance.below(2 * most + 1)).saturating_sub(most),
        };
        self.edge(strayed_ps, level);
        if self.errors.glitch_ns > 0 {
            let width_ps = self.chance.between(1, self.errors.glitch_ns * PS_PER_NS);
            let start_ps = strayed_ps + 1 + self.chance.below(for_ps - width_ps - 1);
            self.edge(start_ps, !level);
            self.edge(start_ps + width_ps, level);
        }
    }

    /// Brings the line to rest at a level.
    pub(crate) fn rest_at(&mut self, level: bool) {
        self.edge(self.now_ps, level);
    }

    /// Waits until this time, without an edge.
    pub(crate) fn wait_until(&mut self, ps: u64) {
        self.now_ps = self.now_ps.max(ps);
        self.settle_until(self.ticks(self.now_ps));
    }

    /// Sends 16 bits from the edge `first` on, and rests for two bits. A bidirectional rate inverts both
    /// the levels and the checksum.
    pub(crate) fn frame_from(&mut self, first: usize, rate: Rate, bidirectional: bool, bits: u16) {
        let mut bits = bits ^ check_mask(bidirectional);
        if self.errors.flipped_permille > 0 {
            for bit in 0..16 {
                let flipped = self.chance.below(1000) < self.errors.flipped_permille;
                bits ^= u16::from(flipped) << bit;
            }
        }
        let start_ps = self.now_ps;
        let end_ns = rate.frame_ns() + 2 * rate.bit_ns();
        let mut played = edges(bits, rate)
            .chain([(end_ns, true)])
            .skip(first)
            .peekable();
        while let Some((at_ns, active)) = played.next() {
            let at_ps = start_ps + self.sent(u64::from(at_ns) * PS_PER_NS);
            let Some((next_ns, _)) = played.peek() else {
                self.now_ps = at_ps;
                break;
            };
            let next_ps = start_ps + self.sent(u64::from(*next_ns) * PS_PER_NS);
            self.level(at_ps, active != bidirectional, next_ps - at_ps);
        }
    }

    /// Sends 16 bits.
    pub(crate) fn frame(&mut self, rate: Rate, bidirectional: bool, bits: u16) {
        self.frame_from(0, rate, bidirectional, bits);
    }

    /// Sends a pulse of this width, and rests for a sixteenth of it.
    pub(crate) fn pulse(&mut self, width_ns: u64) {
        let width_ps = self.sent(width_ns * PS_PER_NS);
        let low_ps = (width_ps / 16).max(2_000 * PS_PER_NS);
        self.level(self.now_ps, true, width_ps);
        self.level(self.now_ps + width_ps, false, low_ps);
        self.now_ps += width_ps + low_ps;
    }
}

/// Returns a signal's duration with the shortest rest after it, ns: how many fit into a second.
pub(crate) fn least_period_ns(signal: Signal) -> u64 {
    match signal {
        Signal::Dshot {
            rate,
            bidirectional,
        } => {
            // A bidirectional frame is followed by 30 µs, its 21-bit reply at 5/4 of the rate, and a rest.
            let reply_ns = 30_000 + 21 * 4 / 5 * rate.bit_ns();
            let rest_ns = 2 * rate.bit_ns();
            let answer_ns = if bidirectional { reply_ns } else { 0 };
            u64::from(rate.frame_ns() + answer_ns + rest_ns) * 21 / 20
        }
        Signal::Pulse(Pulse::Servo) => 1_000_000_000 / 490,
        Signal::Pulse(Pulse::OneShot125) => 1_000_000_000 / 4_000,
        Signal::Pulse(Pulse::OneShot42) => 1_000_000_000 / 12_000,
        Signal::Pulse(Pulse::Multishot) => 1_000_000_000 / 32_000,
    }
}
