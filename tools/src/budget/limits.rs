//! Table 1 of the second paper, solved for speed.
//!
//! Leading and lagging errors are summed separately, each at its worst: hold-off and digital delay may be
//! anything from zero to their full amount, so they cannot be relied on to cancel a lead.
//!
//! Between the speeds at which N or A_e change, every contribution is a convex function of speed: those due
//! to acceleration fall like 1/ω², the integrator's like 1/ω, and the rest grow with ω. So is the larger of
//! the two sums, and the speeds at which it is within a bound form one range.

use siskin_control::control::observer::limits;

/// N when the speed is measured from edge to edge.
const EDGE_TO_EDGE: f64 = 1.0 / 6.0;

/// Bisection steps: as many as a double has bits.
const HALVINGS: usize = 64;

/// Steps of the search for the minimum error, each of which keeps two thirds: down to 1e-15.
const THIRDS: usize = 90;

/// How long crossings are ignored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum HoldOff {
    /// T_h, s.
    Time(f64),
    /// Electrical degrees at the estimated speed.
    Angle(f64),
}

/// What the errors follow from. Speeds are electrical, rad/s; accelerations rad/s².
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Settings {
    /// τ_int, s; may be infinite.
    pub(crate) tau_int_s: f64,
    /// τ_HPFS of the second-order form, s; may be infinite.
    pub(crate) tau_hpfs_s: Option<f64>,
    pub(crate) hold_off: HoldOff,
    /// N.
    pub(crate) turns: f64,
    /// Whether every crossing completes a speed measurement, as in the drive; otherwise one in N turns
    /// does, as in the paper.
    pub(crate) every_edge: bool,
    /// Below this speed N is 1/6.
    pub(crate) whole_turns_above: f64,
    /// A_e.
    pub(crate) a_e: f64,
    /// Below this speed A_e is 0.
    pub(crate) filter_above: f64,
    /// T_s, s.
    pub(crate) period_s: f64,
    pub(crate) acceleration: f64,
    pub(crate) braking: f64,
}

/// A row of Table 1, as printed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Contribution {
    pub(crate) source: &'static str,
    pub(crate) deg: f64,
}

/// The errors in one direction at a given speed, without those that are zero, largest first.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Errors {
    /// Whether the estimate is ahead of the rotor.
    pub(crate) leads: bool,
    pub(crate) contributions: Vec<Contribution>,
}

/// A speed at which the bound is reached, and what reaches it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct End {
    /// Electrical speed, rad/s.
    pub(crate) omega: f64,
    /// The errors just beyond.
    pub(crate) errors: Errors,
}

/// A range of speeds within the bound; without a lowest one it begins at standstill.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Range {
    pub(crate) lowest: Option<End>,
    pub(crate) highest: End,
}

/// N and A_e between two speeds.
struct Piece {
    turns: f64,
    a_e: f64,
    from: f64,
    to: f64,
}

impl Errors {
    /// Returns their sum.
    pub(crate) fn total_deg(&self) -> f64 {
        self.contributions.iter().map(|row| row.deg).sum()
    }
}

impl Settings {
    /// Returns the speed ranges in which no error exceeds the bound, lowest first.
    pub(crate) fn ranges(&self, bound_deg: f64) -> Vec<Range> {
        let mut found: Vec<(f64, f64)> = Vec::new();
        let pieces = self.pieces(bound_deg);
        for piece in &pieces {
            let Some((low, high)) = self.within(piece, bound_deg) else {
                continue;
            };
            match found.last_mut() {
                Some(last) if last.1 == low => last.1 = high,
                _ => found.push((low, high)),
            }
        }
        let end = |omega, piece: Option<&Piece>| {
            piece.map(|piece| End {
                omega,
                errors: self.worst(piece, omega),
            })
        };
        let range = |(low, high): (f64, f64)| {
            // Just beyond an end, N and A_e may differ.
            let below = pieces.iter().find(|p| p.from < low && low <= p.to);
            let above = pieces.iter().find(|p| p.from <= high && high < p.to);
            Some(Range {
                lowest: end(low, below),
                highest: end(high, above.or(pieces.last()))?,
            })
        };
        found.into_iter().filter_map(range).collect()
    }

    /// Returns the speed with the smallest error, up to where the delay alone reaches the bound.
    pub(crate) fn best(&self, bound_deg: f64) -> Option<End> {
        let ends = self.pieces(bound_deg).into_iter().map(|piece| {
            let omega = self.quietest(&piece);
            End {
                omega,
                errors: self.worst(&piece, omega),
            }
        });
        ends.min_by(|one, other| one.errors.total_deg().total_cmp(&other.errors.total_deg()))
    }

    /// Returns N and A_e over speed, up to where the digital delay alone reaches the bound.
    fn pieces(&self, bound_deg: f64) -> Vec<Piece> {
        let top = bound_deg.to_radians() / self.period_s;
        let mut ends = [0.0, self.whole_turns_above, self.filter_above, top];
        ends.iter_mut().for_each(|end| *end = end.min(top));
        ends.sort_by(f64::total_cmp);
        let pairs = ends.windows(2).filter(|pair| pair[0] < pair[1]);
        pairs
            .map(|pair| Piece {
                turns: if pair[0] >= self.whole_turns_above {
                    self.turns
                } else {
                    EDGE_TO_EDGE
                },
                a_e: if pair[0] >= self.filter_above {
                    self.a_e
                } else {
                    0.0
                },
                from: pair[0],
                to: pair[1],
            })
            .collect()
    }

    /// Returns the part of a piece that is within the bound.
    fn within(&self, piece: &Piece, bound_deg: f64) -> Option<(f64, f64)> {
        let sound = |omega| self.worst(piece, omega).total_deg() <= bound_deg;
        let middle = self.quietest(piece);
        if !sound(middle) {
            return None;
        }
        let limit = |end: f64| {
            if sound(end) {
                return end;
            }
            let (mut inside, mut outside) = (middle, end);
            for _ in 0..HALVINGS {
                let between = 0.5 * (inside + outside);
                if sound(between) {
                    inside = between;
                } else {
                    outside = between;
                }
            }
            inside
        };
        Some((limit(piece.from), limit(piece.to)))
    }

    /// Returns where in a piece the error is smallest: a single point, as the function is convex.
    fn quietest(&self, piece: &Piece) -> f64 {
        let total = |omega| self.worst(piece, omega).total_deg();
        let (mut low, mut high) = (piece.from, piece.to);
        for _ in 0..THIRDS {
            let third = (high - low) / 3.0;
            let (one, other) = (total(low + third), total(high - third));
            // It is infinite at low speeds only.
            if one > other || one.is_infinite() {
                low += third;
            } else {
                high -= third;
            }
        }
        [piece.from, piece.to]
            .into_iter()
            .fold(0.5 * (low + high), |best, end| {
                if total(end) <= total(best) { end } else { best }
            })
    }

    /// Returns the larger of the leading and the lagging errors.
    fn worst(&self, piece: &Piece, omega: f64) -> Errors {
        let by_acceleration = |alpha: f64| {
            let k = if self.every_edge {
                limits::acceleration_every_edge(piece.turns, alpha, omega)
            } else {
                limits::acceleration(piece.turns, alpha, omega)
            };
            let filter = limits::position_filter(piece.a_e, piece.turns, alpha, omega);
            [
                ("extrapolation", limits::extrapolation(k)),
                ("position filter", filter),
            ]
        };
        let integrator = match self.tau_hpfs_s {
            None => limits::low_pass(self.tau_int_s, omega),
            Some(tau_s) => limits::second_order(self.tau_int_s, tau_s, omega),
        };
        let hold_off = match self.hold_off {
            HoldOff::Time(time_s) => limits::hold_off(time_s, omega),
            HoldOff::Angle(deg) => deg,
        };
        let leading = [("flux integrator", integrator)];
        let lagging = [
            ("hold-off", hold_off),
            ("digital delay", limits::digital_delay(self.period_s, omega)),
        ];
        let lead = errors(true, leading, by_acceleration(-self.braking));
        let lag = errors(false, lagging, by_acceleration(self.acceleration));
        if lead.total_deg() > lag.total_deg() {
            lead
        } else {
            lag
        }
    }
}

fn errors<const N: usize>(
    leads: bool,
    always: [(&'static str, f64); N],
    by_acceleration: [(&'static str, f64); 2],
) -> Errors {
    let rows = always.into_iter().chain(by_acceleration);
    let mut contributions: Vec<_> = rows
        .filter(|(_, deg)| *deg > 0.0)
        .map(|(source, deg)| Contribution { source, deg })
        .collect();
    contributions.sort_by(|one, other| other.deg.total_cmp(&one.deg));
    Errors {
        leads,
        contributions,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Electrical rad/s per mechanical rpm, 14 poles.
    const RAD_S_PER_RPM: f64 = 7.0 * std::f64::consts::TAU / 60.0;

    /// Figure 28: acceleration and sampling only.
    fn figure_28() -> Settings {
        Settings {
            tau_int_s: f64::INFINITY,
            tau_hpfs_s: None,
            hold_off: HoldOff::Time(0.0),
            turns: 1.0,
            every_edge: false,
            whole_turns_above: 0.0,
            a_e: 0.0,
            filter_above: 0.0,
            period_s: 1.0 / 15_625.0,
            acceleration: 10_000.0 * RAD_S_PER_RPM,
            braking: 0.0,
        }
    }

    fn rpm(settings: &Settings, bound_deg: f64) -> Vec<(f64, f64)> {
        let ranges = settings.ranges(bound_deg).into_iter();
        ranges
            .map(|range| {
                let low = range.lowest.map_or(0.0, |end| end.omega);
                (low / RAD_S_PER_RPM, range.highest.omega / RAD_S_PER_RPM)
            })
            .collect()
    }

    #[track_caller]
    fn assert_about(found: &[(f64, f64)], low: f64, high: f64) {
        let [(from, to)] = *found else {
            panic!("{found:?}")
        };
        // The paper says "about 1,000" where its formula gives 885; the rest is within 5 %.
        assert!((from / low - 1.0).abs() < 0.15, "{from}");
        assert!((to / high - 1.0).abs() < 0.05, "{to}");
    }

    #[test]
    fn the_ranges_are_those_that_the_paper_reads_off_its_figures() {
        assert_about(&rpm(&figure_28(), 10.0), 1000.0, 3400.0);
        assert_about(&rpm(&figure_28(), 20.0), 500.0, 7300.0);
        let figure_30 = Settings {
            a_e: 0.9,
            ..figure_28()
        };
        assert_about(&rpm(&figure_30, 20.0), 2000.0, 7300.0);
    }

    #[test]
    fn every_end_is_at_the_bound_and_what_limits_it_adds_up() {
        let settings = Settings {
            tau_int_s: 0.05,
            tau_hpfs_s: Some(0.5),
            braking: 8_000.0 * RAD_S_PER_RPM,
            hold_off: HoldOff::Time(20e-6),
            a_e: 0.5,
            ..figure_28()
        };
        let ranges = settings.ranges(20.0);
        assert_eq!(ranges.len(), 1);
        let lowest = ranges[0].lowest.as_ref().expect("it does not stand");
        assert!(lowest.errors.leads, "braking leads by more");
        for end in [lowest, &ranges[0].highest] {
            assert!((end.errors.total_deg() - 20.0).abs() < 1e-6);
            let rows = &end.errors.contributions;
            assert!(rows.windows(2).all(|pair| pair[0].deg >= pair[1].deg));
        }
        let most = ranges[0].highest.errors.contributions[0];
        assert_eq!(most.source, "digital delay");
    }

    #[test]
    fn a_filter_that_begins_too_early_leaves_a_gap() {
        let settings = Settings {
            a_e: 0.9,
            filter_above: 1200.0 * RAD_S_PER_RPM,
            ..figure_28()
        };
        let found = rpm(&settings, 20.0);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((found[0].1 - 1200.0).abs() < 1e-6, "{found:?}");
        assert!(found[1].0 > 1500.0 && found[1].0 < 2000.0, "{found:?}");
        // The filter that begins there ends the range.
        let end = &settings.ranges(20.0)[0].highest;
        assert_eq!(end.errors.contributions[0].source, "position filter");
        assert!(end.errors.total_deg() > 20.0);
    }

    #[test]
    fn whole_turns_that_begin_late_change_nothing_where_both_are_within() {
        let settings = Settings {
            whole_turns_above: 1500.0 * RAD_S_PER_RPM,
            ..figure_28()
        };
        let [(from, to)] = rpm(&settings, 20.0)[..] else {
            panic!("one range")
        };
        // (18N − 1) is 2 instead of 17.
        assert!(from < 200.0 && (to - 7300.0).abs() < 200.0, "{from} {to}");
    }

    #[test]
    fn a_speed_that_every_crossing_measures_holds_from_a_lower_one() {
        let settings = Settings {
            every_edge: true,
            ..figure_28()
        };
        let lowest = |settings: &Settings| rpm(settings, 10.0)[0].0;
        // √(7/17) of it, if sampling added nothing.
        let share = lowest(&settings) / lowest(&figure_28());
        assert!((0.55..0.65).contains(&share), "{share}");
    }

    #[test]
    fn without_acceleration_or_lead_it_holds_from_standstill() {
        let settings = Settings {
            acceleration: 0.0,
            ..figure_28()
        };
        let ranges = settings.ranges(20.0);
        assert_eq!(ranges.len(), 1);
        assert_eq!(ranges[0].lowest, None);
        assert!((ranges[0].highest.errors.total_deg() - 20.0).abs() < 1e-6);
    }

    #[test]
    fn where_nothing_is_within_the_best_speed_is_told() {
        assert!(figure_28().ranges(3.0).is_empty());
        let best = figure_28().best(3.0).expect("a speed");
        assert!(best.errors.total_deg() > 3.0);
        // The error is nowhere smaller up to there.
        for step in 1..1000 {
            let omega = 3.0_f64.to_radians() * 15_625.0 * f64::from(step) / 1000.0;
            let piece = &figure_28().pieces(3.0)[0];
            let total = figure_28().worst(piece, omega).total_deg();
            assert!(total >= best.errors.total_deg() - 1e-9, "{omega}");
        }
    }
}
