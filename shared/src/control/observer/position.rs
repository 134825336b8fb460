//! The position estimator (second paper, section 2.4): linear extrapolation from the last edge, with the speed from
//! the time between edges. Flux crossings and Hall sensors trigger it alike.
//!
//! The paper measures the speed over N turns once every N turns. Here every edge ends a measurement over the last N
//! turns, so the middles of measurement and extrapolation are (3N + 0.5)·60° apart instead of up to (9N − 0.5)·60°,
//! the source of appendix A's error.

use fixed::types::U20F12;
use siskin_units::math::{Gain, divide};
use siskin_units::{Angle, QUARTER_TURN, Speed, traced};

use super::sector::Sector;

/// A time in control periods.
pub type Periods = U20F12;

/// Coefficients of the estimator.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// N, the electrical turns over which the speed is measured, 1 to 4.
    pub turns: u8,
    /// Below this speed it is measured from edge to edge (2.5.2, item 3): over whole turns it would lag too much.
    /// Zero means never.
    pub whole_turns_above: Speed,
    /// A_e, the share of the extrapolated angle that survives an edge (2.4.2), 0 to below 1.
    pub a_e: Gain<Angle, Angle>,
    /// The speed above which A_e applies.
    pub filter_above: Speed,
    /// Compensate for an edge's known angle and for its time before the sample. The paper's figures 28 and 30 do
    /// not.
    pub compensates: bool,
}

traced! {
    /// The estimator's state.
    #[derive(Clone, Debug, Default, PartialEq)]
    pub struct State {
        /// θ̂ at this sample.
        pub theta: Angle,
        /// θ_inc, the angle extrapolated since the last edge: 0 to 90°.
        pub theta_inc: Angle,
        /// ω̂.
        pub omega: Speed,
        /// Change of ω̂ per period, between the last two measurements.
        pub omega_step: Speed,
        /// Periods since the sample that saw the last edge.
        pub since: u32,
        /// Time from the edge to that sample.
        pub late: Periods,
        /// The last intervals between edges, a ring buffer.
        pub intervals: [Periods; EDGES_MAX],
        /// Position of the next interval.
        pub next: u8,
        /// Number of intervals, at most those of N turns.
        pub edges: u8,
        /// Their sum.
        pub window: Periods,
        /// The last edge was seen, so the next interval is valid.
        pub timed: bool,
    }
}

/// Edges in the largest N.
const EDGES_MAX: usize = 6 * TURNS_MAX as usize;

/// Largest N.
pub const TURNS_MAX: u8 = 4;

/// θ_inc ≤ 90° (2.4.1).
const LIMIT: Angle = QUARTER_TURN;

/// If the estimated speed would have covered a third of a turn without an edge, it was twice too high: the rotor
/// has turned less than a sixth.
const THIRD_TURN: u64 = (1 << 32) / 3;

/// Below a quarter of a turn per period; above, sectors could not be told apart.
const OMEGA_MAX: u64 = (1 << 30) - 1;

/// Returns the angle turned in this many periods, in turns with 32 fraction bits.
pub(super) fn turned(periods: u32, omega: Speed) -> u64 {
    u64::from(periods) * u64::from(omega.to_bits().max(0) as u32)
}

/// Extrapolates by one period without news (2.4.1).
pub fn advance(state: &mut State) {
    let step = state.omega.over_period().min(LIMIT - state.theta_inc);
    state.theta = state.theta.wrapping_add(step);
    state.theta_inc += step;
    state.since = state.since.saturating_add(1);
    if state.theta_inc == LIMIT && turned(state.since, state.omega) >= THIRD_TURN {
        halve_speed(state);
    }
}

#[cold]
fn halve_speed(state: &mut State) {
    state.omega = state.omega >> 1;
    state.omega_step = Speed::ZERO;
    discard_intervals(state);
}

/// Excludes the intervals so far from the next measurements.
fn discard_intervals(state: &mut State) {
    state.edges = 0;
    state.window = Periods::ZERO;
}

/// Uses the time of an edge, `late` before this sample, to measure the speed.
pub fn time_edge(config: &Config, state: &mut State, late: Periods) {
    let since = Periods::saturating_from_num(state.since);
    let interval = since.saturating_add(state.late).saturating_sub(late);
    state.since = 0;
    state.late = late;
    if !state.timed {
        state.timed = true;
        discard_intervals(state);
        return;
    }
    let wanted = 6 * config.turns.clamp(1, TURNS_MAX);
    store_interval(state, interval, wanted);
    // 32 + 12 fraction bits. Slow: at that speed the rotor would have turned more than a sixth in the interval.
    let whole_turns = u64::from(config.whole_turns_above.to_bits().max(0) as u32);
    if u64::from(interval.to_bits()) * whole_turns > (1 << 44) / 6 {
        set_speed(state, 1, interval);
    } else if state.edges == wanted {
        set_speed(state, wanted, state.window);
    }
}

/// Stores an interval in the ring, replacing the oldest once the wanted number is there.
fn store_interval(state: &mut State, interval: Periods, wanted: u8) {
    let size = EDGES_MAX as u8;
    if state.edges >= wanted {
        let oldest = usize::from((state.next + size - wanted) % size);
        state.window = state.window.saturating_sub(state.intervals[oldest]);
    } else {
        state.edges += 1;
    }
    state.intervals[usize::from(state.next % size)] = interval;
    state.next = (state.next + 1) % size;
    state.window = state.window.saturating_add(interval);
}

/// Sets ω̂ from this many sixths of a turn in this time.
fn set_speed(state: &mut State, sixths: u8, time: Periods) {
    // Turns with 44 fraction bits over periods with 12.
    let turns = divide(u64::from(sixths) << 44, 6);
    let omega = divide(turns, time.to_bits().max(1)).min(OMEGA_MAX);
    let before = state.omega.to_bits();
    state.omega_step = if before == 0 {
        Speed::ZERO
    } else {
        // The change over the time between two edges, 1/(6·ω̂).
        let change = i64::from(omega as i32 - before) * (6 * omega) as i64;
        Speed::from_bits((change >> 32) as i32)
    };
    state.omega = Speed::from_bits(omega as i32);
}

/// Uses the position of an edge: the start of `sector`, where the rotor was [`State::late`] before this sample,
/// `ahead` of the nominal edge. Merges it with the extrapolated angle (2.4.2).
pub fn place_at_edge(config: &Config, state: &mut State, sector: Sector, ahead: Angle) {
    let mut theta = sector.begin();
    if config.compensates {
        // 32 + 12 − 12 fraction bits; less than two periods at less than a quarter turn each.
        let since = i64::from(state.omega.to_bits()) * i64::from(state.late.to_bits());
        let since = Angle::from_bits((since >> Periods::FRAC_NBITS) as i32);
        theta = theta.wrapping_add(ahead).wrapping_add(since);
    }
    state.theta_inc = Angle::ZERO;
    state.theta = if state.omega == Speed::ZERO {
        // Nothing will be extrapolated: the middle is at most half a sector off.
        sector.middle()
    } else if state.omega >= config.filter_above {
        let extrapolated = state.theta.wrapping_sub(theta);
        theta.wrapping_add(config.a_e.apply(extrapolated))
    } else {
        theta
    };
}

/// Puts the rotor where it must be, and restarts the speed measurement at the next edge.
pub fn set_angle(state: &mut State, theta: Angle) {
    state.theta = theta;
    state.theta_inc = Angle::ZERO;
    restart_timing(state);
}

/// Restarts the speed measurement: the next edges come from another source.
pub fn restart_timing(state: &mut State) {
    // The next edge discards the intervals so far.
    state.timed = false;
    state.omega_step = Speed::ZERO;
}

/// Sets the rotor to rest, somewhere in this sector.
pub fn set_to_rest(state: &mut State, sector: Sector) {
    set_angle(state, sector.middle());
    state.omega = Speed::ZERO;
}

/// Begins at this angle and speed; a negative speed counts as zero.
pub fn begin(state: &mut State, theta: Angle, omega: Speed) {
    *state = State {
        theta,
        omega: omega
            .max(Speed::ZERO)
            .min(Speed::from_bits(OMEGA_MAX as i32)),
        ..State::default()
    };
}

#[cfg(test)]
mod tests;
