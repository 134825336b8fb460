//! The comparators at the low sides' shunts, which turn all switches off without the control's help.

/// Time from a current beyond their level to switches off, s: their filter and the gate drivers.
const ACT_S: f64 = 1e-6;

/// Interval at which the currents of a short are checked, s: real comparators check continuously. All others are
/// checked at the switches' edges.
const LOOK_S: f64 = 0.25e-6;

/// Rounding error of a time, s.
const ROUNDING_S: f64 = 1e-15;

/// The comparators of all legs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Comparators {
    /// Current through a low side at which they act, A.
    pub(super) level_a: f64,
    /// Whether they have acted, and the drive has not yet.
    pub(super) tripped: bool,
    /// When they will act, s from now; infinite for never.
    act_s: f64,
    /// For how long the current may have been beyond their level, s.
    beyond_s: f64,
    /// That time at their last act, s.
    answer_s: Option<f64>,
}

impl Comparators {
    /// Creates comparators without a level.
    pub(super) fn new() -> Self {
        Self {
            level_a: f64::INFINITY,
            tripped: false,
            act_s: f64::INFINITY,
            beyond_s: 0.0,
            answer_s: None,
        }
    }

    /// Discards what they have seen.
    pub(super) fn rest(&mut self) {
        self.act_s = f64::INFINITY;
        self.beyond_s = 0.0;
    }

    /// Shows them the shunts' currents, which may be those of a short. Returns the time until they must look again, or
    /// act, s.
    pub(super) fn look(&mut self, shunts_a: [f64; 3], shorts: bool) -> f64 {
        if self.act_s < f64::INFINITY {
            return self.act_s;
        }
        if shunts_a.iter().any(|shunt_a| shunt_a.abs() > self.level_a) {
            self.act_s = ACT_S;
            return ACT_S;
        }
        self.beyond_s = 0.0;
        if shorts { LOOK_S } else { f64::INFINITY }
    }

    /// Advances time; returns true if they act at its end.
    pub(super) fn pass(&mut self, time_s: f64) -> bool {
        self.act_s -= time_s;
        self.beyond_s += time_s;
        let acts = self.act_s < ROUNDING_S;
        if acts {
            self.tripped = true;
            self.answer_s = Some(self.beyond_s);
            self.rest();
        }
        acts
    }

    /// Returns the time from a current beyond their level to switches off, s, at their last act.
    pub(super) fn answer_s(&self) -> Option<f64> {
        self.answer_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The current may have reached its level just after the previous look.
    #[test]
    fn they_act_a_microsecond_after_they_have_seen_it() {
        let mut comparators = Comparators::new();
        comparators.level_a = 30.0;
        for _ in 0..3 {
            assert_eq!(comparators.look([29.9, -29.9, 0.0], true), LOOK_S);
            assert!(!comparators.pass(LOOK_S));
        }
        assert_eq!(comparators.look([0.0, -30.1, 0.0], true), ACT_S);
        assert!(!comparators.pass(0.6e-6) && !comparators.tripped);
        // The current meanwhile does not matter.
        assert!(comparators.look([0.0; 3], true) < 0.5e-6);
        assert!(comparators.pass(0.4e-6) && comparators.tripped);
        let answer_s = comparators.answer_s().expect("they have acted");
        assert!((answer_s - 1.25e-6).abs() < 1e-12, "{answer_s}");
    }
}
