//! Glitch filter: drops levels too short to be part of a signal.
//!
//! An edge is accepted once its level has lasted for the filter time. A shorter level is dropped, and the level
//! around it continues.

/// An accepted edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Edge {
    /// Capture time.
    pub(super) at_ticks: u32,
    /// The level from then on.
    pub(super) level: bool,
}

/// The result of one edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Filtered {
    /// The previous edge, if this one confirms it.
    pub(super) believed: Option<Edge>,
    /// An edge was missed before this one: the line already had this level.
    pub(super) missed: bool,
}

/// The glitch filter of one line.
#[derive(Clone, Debug)]
pub(super) struct Filter {
    /// How long a level must last, ticks.
    pub(super) time_ticks: u32,
    /// The accepted level; `None` before the first edge.
    level: Option<bool>,
    /// An edge away from it, not yet accepted.
    pending: Option<Edge>,
}

impl Filter {
    pub(super) fn new(time_ticks: u32) -> Self {
        Self {
            time_ticks,
            level: None,
            pending: None,
        }
    }

    /// Takes an edge as the timer captured it.
    pub(super) fn edge(&mut self, at_ticks: u32, level: bool) -> Filtered {
        // Fast path for the edges of a clean signal.
        if let Some(pending) = self.pending
            && pending.level != level
            && at_ticks.wrapping_sub(pending.at_ticks) >= self.time_ticks
        {
            self.level = Some(pending.level);
            self.pending = Some(Edge { at_ticks, level });
            return Filtered {
                believed: Some(pending),
                missed: false,
            };
        }
        let believed = match self.pending {
            Some(pending) if at_ticks.wrapping_sub(pending.at_ticks) >= self.time_ticks => {
                self.believe()
            }
            _ => None,
        };
        let before = self
            .pending
            .map_or(self.level, |pending| Some(pending.level));
        let missed = before == Some(level);
        if missed || self.level == Some(level) {
            // The missed edge hides when this level began.
            self.level = Some(level);
            self.pending = None;
        } else {
            self.level = Some(!level);
            self.pending = Some(Edge { at_ticks, level });
        }
        Filtered { believed, missed }
    }

    /// Accepts the last edge if its level has lasted until now.
    pub(super) fn settle(&mut self, now_ticks: u32) -> Option<Edge> {
        let pending = self.pending?;
        (since(now_ticks, pending.at_ticks) >= self.time_ticks)
            .then(|| self.believe())
            .flatten()
    }

    /// Returns true if the line is known to rest at this level, or nothing is known of it.
    pub(super) fn rests_at(&self, level: bool) -> bool {
        self.pending.is_none() && self.level.is_none_or(|believed| believed == level)
    }

    /// Sets the line's level after its edges were judged elsewhere.
    pub(super) fn settled(&mut self, level: bool) {
        self.level = Some(level);
    }

    /// Forgets the level after a silence, so that it cannot affect the next edge.
    pub(super) fn rest(&mut self) {
        self.level = None;
    }

    /// Returns the last edge while it is not yet accepted.
    pub(super) fn pending(&self) -> Option<Edge> {
        self.pending
    }

    /// Accepts the last edge, however short its level.
    pub(super) fn believe(&mut self) -> Option<Edge> {
        let edge = self.pending.take()?;
        self.level = Some(edge.level);
        Some(edge)
    }
}

/// Returns the ticks from `at_ticks` to `now_ticks`, or 0 if `at_ticks` is later: an edge may be captured after
/// the time was read.
pub(super) fn since(now_ticks: u32, at_ticks: u32) -> u32 {
    (now_ticks.wrapping_sub(at_ticks) as i32).max(0) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    /// Returns the levels that a 10-tick filter accepts for these edges, given time after the last.
    fn believed(edges: &[(u32, bool)]) -> Vec<(u32, bool)> {
        let mut filter = Filter::new(10);
        let mut believed: Vec<_> = edges
            .iter()
            .filter_map(|&(at_ticks, level)| filter.edge(at_ticks, level).believed)
            .collect();
        let end = edges.last().map_or(0, |(at_ticks, _)| at_ticks + 1000);
        believed.extend(filter.settle(end));
        assert_eq!(filter.settle(end + 1000), None);
        believed
            .iter()
            .map(|edge| (edge.at_ticks, edge.level))
            .collect()
    }

    #[test]
    fn levels_that_last_are_believed_at_their_first_edge() {
        let edges = [(100, true), (110, false), (120, true), (500, false)];
        assert_eq!(believed(&edges), edges);
    }

    #[test]
    fn shorter_levels_vanish() {
        let around = [(100, true), (300, false)];
        for start in [120, 150, 289] {
            let edges = [
                around[0],
                (start, false),
                (start + 9, true),
                around[1],
                (320, true),
                (329, false),
            ];
            assert_eq!(believed(&edges), around, "{start}");
        }
    }

    #[test]
    fn a_contact_that_bounces_counts_from_its_last_bounce() {
        let edges = [
            (100, true),
            (103, false),
            (106, true),
            (109, false),
            (112, true),
        ];
        assert_eq!(believed(&edges), [(112, true)]);
    }

    #[test]
    fn the_end_of_a_level_waits_for_the_filter() {
        let mut filter = Filter::new(10);
        filter.edge(u32::MAX - 3, true);
        assert_eq!(filter.settle(u32::MAX - 4), None, "before the edge");
        assert_eq!(filter.settle(5), None);
        let edge = Edge {
            at_ticks: u32::MAX - 3,
            level: true,
        };
        assert_eq!(filter.settle(6), Some(edge));
    }

    #[test]
    fn an_edge_to_the_same_level_tells_of_a_missed_one() {
        let mut filter = Filter::new(10);
        assert!(!filter.edge(100, true).missed, "no level was known");
        let filtered = filter.edge(200, true);
        assert!(filtered.missed);
        assert_eq!(filtered.believed.map(|edge| edge.at_ticks), Some(100));
        assert!(!filter.edge(300, false).missed);
        assert_eq!(filter.settle(400).map(|edge| edge.at_ticks), Some(300));
        assert!(filter.edge(500, false).missed);
        filter.rest();
        assert!(!filter.edge(900, false).missed, "after a silence");
    }
}
