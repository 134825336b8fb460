//! Watches the bridge's gates as a logic analyser at the pins would: it knows nothing about the timer that
//! drives them.

use std::fmt;

use crate::gate_supply::GateSupply;
use crate::time::{CLOCK_HZ, Cycles, NEVER};

/// Legs of the bridge.
const LEGS: usize = 3;

/// Violations kept; the rest are only counted.
const KEPT: usize = 8;

/// What must not happen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Both gates of a leg are on.
    Both,
    /// One gate turned on this few cycles after the other had turned off.
    Short(Cycles),
}

/// A violation, with place and time. Displayed on one line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Violation {
    /// When it happened.
    pub at: Cycles,
    /// The leg, from 0.
    pub leg: usize,
    /// What happened.
    pub fault: Fault,
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let Self { at, leg, fault } = self;
        let t_s = *at as f64 / CLOCK_HZ as f64;
        match fault {
            Fault::Both => write!(
                f,
                "both gates of the leg of phase {leg} are on at {t_s:.6} s"
            ),
            Fault::Short(cycles) => write!(
                f,
                "a gate of the leg of phase {leg} goes on {cycles} cycles after the other has gone off, at {t_s:.6} s"
            ),
        }
    }
}

/// A leg's gates, high side and low side, and its high-side driver's supply.
#[derive(Clone, Copy, Debug, Default)]
struct Leg {
    on: [bool; 2],
    off_at: [Option<Cycles>; 2],
    supply: GateSupply,
}

/// The watch. All gates are off at first.
#[derive(Clone, Debug)]
pub struct Bridge {
    dead_time: Cycles,
    legs: [Leg; LEGS],
    edges: u64,
    off_since: Cycles,
    kept: Vec<Violation>,
    count: u64,
    starved: u64,
}

impl Bridge {
    /// Creates a watch for this minimum dead time.
    pub fn new(dead_time: Cycles) -> Self {
        Self {
            dead_time,
            legs: [Leg::default(); LEGS],
            edges: 0,
            off_since: 0,
            kept: Vec::with_capacity(KEPT),
            count: 0,
            starved: 0,
        }
    }

    /// Takes the current state of a leg's gates.
    pub fn gates(&mut self, leg: usize, high: bool, low: bool, now: Cycles) {
        let was_off = self.is_off();
        let on = [high, low];
        let before = self.legs[leg].on;
        self.legs[leg].supply.pass(before[1], now);
        if high && !before[0] && !self.legs[leg].supply.turn_on() {
            self.starved += 1;
        }
        for side in 0..2 {
            self.edges += u64::from(on[side] != before[side]);
            if before[side] && !on[side] {
                self.legs[leg].off_at[side] = Some(now);
            }
        }
        self.legs[leg].on = on;
        if on == [true, true] {
            if before != on {
                self.note(leg, Fault::Both, now);
            }
        } else {
            for side in 0..2 {
                let other_off_at = self.legs[leg].off_at[1 - side];
                if let Some(off_at) = other_off_at.filter(|_| on[side] && !before[side]) {
                    let dead = now.saturating_sub(off_at);
                    if dead < self.dead_time {
                        self.note(leg, Fault::Short(dead), now);
                    }
                }
            }
        }
        match (was_off, self.is_off()) {
            (false, true) => self.off_since = now,
            (true, false) => self.off_since = NEVER,
            _ => {}
        }
    }

    fn note(&mut self, leg: usize, fault: Fault, at: Cycles) {
        self.count += 1;
        if self.kept.len() < KEPT {
            self.kept.push(Violation { at, leg, fault });
        }
    }

    /// Returns whether all gates are off.
    pub fn is_off(&self) -> bool {
        self.legs.iter().all(|leg| leg.on == [false, false])
    }

    /// Returns since when all gates have been off, if they are.
    pub fn off_since(&self) -> Option<Cycles> {
        self.is_off().then_some(self.off_since)
    }

    /// Returns a leg's gates: high side, low side.
    pub fn on(&self, leg: usize) -> [bool; 2] {
        self.legs[leg].on
    }

    /// Returns how often a gate has turned on or off.
    pub fn edges(&self) -> u64 {
        self.edges
    }

    /// Returns the number of violations.
    pub fn violations(&self) -> u64 {
        self.count
    }

    /// Returns the first violations.
    pub fn first(&self) -> &[Violation] {
        &self.kept
    }

    /// Returns how often a high side was turned on without enough supply for its driver. Not a violation: a
    /// self-test tries each high side while it charges its supply.
    pub fn starved(&self) -> u64 {
        self.starved
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_proper_change_of_sides_is_none() {
        let mut bridge = Bridge::new(85);
        assert_eq!(bridge.off_since(), Some(0));
        bridge.gates(0, false, true, 100);
        assert_eq!(bridge.off_since(), None);
        bridge.gates(0, false, false, 200);
        bridge.gates(0, true, false, 285);
        // The other leg's timing does not matter.
        bridge.gates(1, false, true, 286);
        bridge.gates(0, false, false, 400);
        // The same side may turn on again at once.
        bridge.gates(0, true, false, 401);
        bridge.gates(0, false, false, 500);
        bridge.gates(1, false, false, 510);
        assert_eq!(bridge.violations(), 0);
        assert_eq!(bridge.edges(), 8);
        assert_eq!(bridge.off_since(), Some(510));
        bridge.gates(1, false, false, 600);
        assert_eq!(bridge.off_since(), Some(510));
    }

    #[test]
    fn an_overlap_is_noticed_once() {
        let mut bridge = Bridge::new(85);
        bridge.gates(2, true, false, 100);
        bridge.gates(2, true, true, 130);
        bridge.gates(2, true, true, 140);
        let both = Violation {
            at: 130,
            leg: 2,
            fault: Fault::Both,
        };
        assert_eq!((bridge.violations(), bridge.first()), (1, &[both][..]));
        let line = both.to_string();
        assert_eq!(
            line,
            "both gates of the leg of phase 2 are on at 0.000001 s"
        );
    }

    #[test]
    fn a_short_dead_time_is_noticed() {
        let mut bridge = Bridge::new(85);
        bridge.gates(1, true, false, 100);
        bridge.gates(1, false, false, 200);
        bridge.gates(1, false, true, 284);
        // In the same cycle.
        bridge.gates(1, true, false, 400);
        let faults: Vec<_> = bridge.first().iter().map(|v| (v.at, v.fault)).collect();
        assert_eq!(faults, [(284, Fault::Short(84)), (400, Fault::Short(0))]);
    }

    #[test]
    fn no_more_than_a_few_are_kept() {
        let mut bridge = Bridge::new(85);
        for number in 0..100 {
            bridge.gates(0, number % 2 == 0, number % 2 == 1, 10 * number);
        }
        assert_eq!(bridge.violations(), 99);
        assert_eq!(bridge.first().len(), KEPT);
    }
}
