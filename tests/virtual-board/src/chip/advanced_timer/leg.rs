//! A leg's dead-time generator and output control.

use crate::time::Cycles;

/// Returns the cycles for a generator code (RM0440, TIM1_BDTR.DTG), with its clock undivided (CKD).
pub(super) fn dead_time(code: u8) -> Cycles {
    let code = Cycles::from(code);
    match code >> 5 {
        0..=3 => code,
        4 | 5 => (64 + (code & 0x3f)) * 2,
        6 => (32 + (code & 0x1f)) * 8,
        _ => (32 + (code & 0x1f)) * 16,
    }
}

/// A channel's output enables; the main output enable and these decide.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Enables {
    /// CCxE.
    pub(super) high: bool,
    /// CCxNE.
    pub(super) low: bool,
}

/// The generator only depends on the reference output's edges: it runs whatever the output control makes of
/// it.
#[derive(Clone, Debug)]
pub(super) struct Leg {
    reference: bool,
    settled_at: Cycles,
    gates: [bool; 2],
}

impl Leg {
    /// Creates one that has been at rest.
    pub(super) const fn new() -> Self {
        Self {
            reference: false,
            settled_at: 0,
            gates: [false; 2],
        }
    }

    /// Follows the reference; `dead_time` is that after a change.
    pub(super) fn follow(&mut self, reference: bool, dead_time: Cycles, now: Cycles) {
        if self.reference != reference {
            self.reference = reference;
            self.settled_at = now + dead_time;
        }
    }

    /// Returns when the dead time ends, if it has not.
    pub(super) fn due(&self) -> Cycles {
        self.settled_at
    }

    /// Returns the gates of the high and the low side if they change (RM0440, output control bits for
    /// complementary channels). An output at its inactive or idle level is low, and so is one that is not
    /// driven: the board's pins have pull-downs.
    pub(super) fn drive(&mut self, main: bool, enables: Enables, now: Cycles) -> Option<[bool; 2]> {
        let settled = now >= self.settled_at;
        let gates = match (main, enables.high, enables.low) {
            (false, ..) | (true, false, false) => [false, false],
            (true, true, false) => [self.reference, false],
            // It is not complemented then.
            (true, false, true) => [false, self.reference],
            (true, true, true) => [self.reference && settled, !self.reference && settled],
        };
        (std::mem::replace(&mut self.gates, gates) != gates).then_some(gates)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_times_in_four_ranges() {
        for (code, cycles) in [
            (0, 0),
            (85, 85),
            (127, 127),
            (0x80, 128),
            (0xbf, 254),
            (0xc0, 256),
            (0xdf, 504),
            (0xe0, 512),
            (0xff, 1008),
        ] {
            assert_eq!(dead_time(code), cycles, "{code:#x}");
        }
    }

    #[test]
    fn a_pulse_shorter_than_the_dead_time_is_swallowed() {
        let both = Enables {
            high: true,
            low: true,
        };
        let mut leg = Leg::new();
        assert_eq!(leg.drive(true, both, 0), Some([false, true]));
        leg.follow(true, 10, 100);
        assert_eq!(leg.drive(true, both, 100), Some([false, false]));
        leg.follow(false, 10, 105);
        assert_eq!(leg.drive(true, both, 105), None);
        assert_eq!(leg.due(), 115);
        assert_eq!(leg.drive(true, both, 115), Some([false, true]));
    }

    #[test]
    fn alone_the_low_side_is_the_reference() {
        let low = Enables {
            high: false,
            low: true,
        };
        let mut leg = Leg::new();
        assert_eq!(leg.drive(true, low, 0), None);
        leg.follow(true, 10, 100);
        assert_eq!(leg.drive(true, low, 100), Some([false, true]));
        assert_eq!(leg.drive(false, low, 101), Some([false, false]));
    }
}
